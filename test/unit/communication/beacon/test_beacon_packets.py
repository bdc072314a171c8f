"""The bytes of the packets of the technique beacon."""

from __future__ import annotations

import pytest

from drone_mesh.communication.beacon.packets import (
    NO_ANCESTORS,
    NONE_BELOW,
    NOT_LISTED,
    Beacon,
    Below,
    Found,
    Motion,
    Search,
    ids_that_fit,
    left_out,
    newer,
    room_below,
    room_near,
)
from drone_mesh.drone.location import Location

HERE = Location(0.0, 0.0, 0.0)
FULL = "13 14 00 07 02 04 09 00 ff 0a 00 f6 ff 14 00 0a f6 00 05 06 08 0b 0c ff ff ff ff"
ROUTER = Beacon(
    gateway=0,
    number=7,
    hops=2,
    parent=4,
    ancestors=(9, 0, 255),
    interval_s=1.0,
    motion=Motion(Location(1.0, -1.0, 2.0), (0.31, -0.31, 0.0)),
    below=Below(5, (6, 8, 11), (12,)),
)


def test_a_beacon_has_these_bytes():
    assert ROUTER.to_body(27) == bytes.fromhex(FULL)


def room_beside(beacon, room):
    """For neighbours, in a beacon of so many bytes."""
    rest = room_below(room, beacon.motion, beacon.gateway_place, beacon.digest)
    return room_near(rest, beacon.below)


def test_neighbours_stand_behind_the_nodes_below():
    shows = ROUTER._replace(near=(3, 14))
    assert room_beside(shows, 27) == 3
    body = bytes.fromhex(FULL[:-8] + "03 0e ff")
    assert shows.to_body(27) == body
    assert Beacon.from_body(body, HERE).near == (3, 14)
    assert Beacon.from_body(body, HERE).below == ROUTER.below


def test_a_beacon_is_decoded_relative_to_the_place_of_its_receiver():
    decoded = Beacon.from_body(bytes.fromhex(FULL), HERE)
    assert decoded._replace(motion=None) == ROUTER._replace(motion=None)
    assert decoded.motion.place == pytest.approx(ROUTER.motion.place)
    assert decoded.motion.velocity == pytest.approx((0.31, -0.31, 0.0), abs=0.01)


def test_places_wrap_and_the_nearest_one_counts():
    far = Location(100_000.0, -50_000.0, 300.0)
    there = Location(100_250.3, -50_100.7, 290.0)
    body = ROUTER._replace(motion=Motion(there, (0.0, 0.0, 0.0))).to_body(27)
    assert Beacon.from_body(body, far).motion.place == pytest.approx(there, abs=0.051)


def test_a_receiver_without_a_place_takes_the_rest():
    decoded = Beacon.from_body(bytes.fromhex(FULL), None)
    assert decoded.motion is None
    assert decoded.below == ROUTER.below


def test_a_beacon_with_everything_leaves_room_for_a_seal():
    assert room_below(20, ROUTER.motion, ROUTER.gateway_place, ROUTER.digest) == 1
    body = ROUTER._replace(below=Below(5, (6,))).to_body(20)
    assert len(body) == 20
    assert Beacon.from_body(body, HERE).below == Below(5, (6,))


@pytest.mark.parametrize("body", ["1f" + 26 * "00", "ff" * 27])
def test_a_beacon_that_claims_more_than_it_holds_is_damaged(body):
    assert Beacon.from_body(bytes.fromhex(body), HERE) is None


@pytest.mark.parametrize(
    ("number", "than", "by"), [(7, 5, 2), (1, 255, 2), (255, 1, -2), (128, 0, -128), (5, 5, 0)]
)
def test_sequence_numbers_go_round(number, than, by):
    assert newer(number, than) == by


def test_a_part_of_the_list_leaves_out_the_other_ids_since_the_part_before():
    assert left_out(Below(200, (250, 3)), (200, 201, 250, 255, 0, 3, 4)) == [201, 255, 0]


def test_a_complete_list_leaves_out_every_other_id():
    assert left_out(Below(8, (2, 8)), range(256)) == [n for n in range(256) if n not in (2, 8)]


def test_an_empty_list_leaves_out_every_id_unless_there_was_no_room_for_any():
    assert left_out(NONE_BELOW, (0, 7)) == [0, 7]
    assert left_out(NOT_LISTED, (0, 7)) == []


def test_many_nodes_below_stand_as_the_first_id_and_a_bit_for_each():
    crowd = ROUTER._replace(below=Below(5, (6, 8, 9, 11, 28, 29), (12,)))
    body = bytes.fromhex(FULL[: 18 * 3] + "05 ff 06 2d 00 c0 0c ff ff")
    body = bytes((body[0] + 2, *body[1:]))
    assert crowd.to_body(27) == body
    assert room_beside(crowd, 27) == 1
    assert Beacon.from_body(body, HERE).below == crowd.below


@pytest.mark.parametrize(
    "ids", [(), (7,), (7, 8, 9), (250, 253, 0, 1, 2), tuple(range(1, 100)), (0, 60, 120, 180)]
)
def test_a_list_of_nodes_below_is_decoded_as_it_was(ids):
    fitting = ids_that_fit(ids, 8)
    body = ROUTER._replace(below=Below(5, fitting)).to_body(27)
    assert Beacon.from_body(body, HERE).below == Below(5, fitting)
    assert fitting == ids[: len(fitting)]


@pytest.mark.parametrize(
    ("ids", "room", "fit"),
    [
        (range(1, 100), 8, 48),  # 6 bytes of bits
        (range(1, 100), 3, 8),
        (range(1, 100), 2, 2),  # no room for any bit
        (range(0, 200, 20), 8, 8),  # far apart: as ids
        (range(250, 252), 8, 2),
    ],
)
def test_so_many_nodes_below_fit(ids, room, fit):
    assert ids_that_fit(ids, room) == tuple(ids[:fit])


@pytest.mark.parametrize(
    "below",
    ["ff", "ff 07", "ff ff 01", "ff fc 04", "fe", "07 08 ff"],  # cut off, 255, 254, ids 254 and 255
)
def test_a_list_that_names_an_id_that_no_node_has_is_damaged(below):
    ids = bytes.fromhex(below)
    head = bytes.fromhex(f"0{len(ids)} 14 00 07 02 04 09 00 ff 05")
    assert Beacon.from_body((head + ids).ljust(27, b"\xff"), HERE) is None


def test_the_broadcast_address_as_gateway_or_as_new_node_is_damage():
    for body in (
        bytes.fromhex("00 14 fe 07 02 04 09 00 ff").ljust(27, b"\xff"),
        bytes.fromhex(FULL).replace(b"\x0c\xff", b"\xfe\xff"),
    ):
        assert Beacon.from_body(body, HERE) is None


def test_a_search_and_its_answer_have_these_bytes():
    assert Search(9, 0x0102, 12).to_body() == bytes.fromhex("09 02 01 0c")
    assert Search.from_body(bytes.fromhex("09 02 01 0c")) == Search(9, 0x0102, 12)
    assert Found(9).to_body() == b"\x09"
    assert Found.from_body(b"\x09" + bytes(26)) == Found(9)


def test_a_router_without_a_gateway_says_so():
    alone = Beacon(255, 0, 255, 255, NO_ANCESTORS, 1.0, looks=True)
    assert alone.to_body(27)[:9] == bytes.fromhex("80 14 ff 00 ff ff ff ff ff")
