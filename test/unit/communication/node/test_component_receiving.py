"""What each node does with a packet from the air: refuse, learn, forward."""

from __future__ import annotations

import logging
import random

import pytest
from rig import Rig, packet

from drone_mesh.communication.interfaces import NO_ROUTE
from drone_mesh.communication.timing import QUEUED, UNDISTURBED, Medium

NAN = "00 00 c0 7f"
INFINITY = "00 00 80 7f"
ONE = "00 00 80 3f"

BAD = {
    "31 bytes": packet("02 02 03 01 fe")[:31],
    "33 bytes": packet("02 02 03 01 fe") + b"\0",
    "no bytes": b"",
    "creator 254": packet("fe 02 03 01 fe"),
    "creator 255": packet("ff 02 03 01 fe"),
    "from 254": packet("02 fe 03 01 fe"),
    "from 255": packet("02 ff 03 01 fe"),
    "forward 255": packet("02 02 03 01 ff"),
    "to another node": packet("02 02 03 03 fe"),
    "to 254": packet("02 02 03 fe fe"),
    "location nowhere": packet(f"02 02 01 01 01 {NAN} {ONE}"),
    "location at infinity": packet(f"02 02 01 01 01 {ONE} {INFINITY}"),
    "order to nowhere": packet(f"02 02 06 01 01 {ONE} {NAN}"),
    "bid of nothing": packet(f"02 02 07 01 01 {NAN}"),
    "order to nowhere for another node": packet(f"02 02 06 01 05 {ONE} {NAN}"),
}


@pytest.mark.parametrize("gateway", [False, True], ids=["router", "gateway"])
@pytest.mark.parametrize("payload", BAD.values(), ids=BAD)
def test_bad_input_teaches_nothing_changes_nothing_and_is_counted(payload, gateway):
    rig = Rig(gateway=gateway)
    reported = list(rig.events)
    rig.mesh.on_msg(payload, 1.0)
    assert rig.routing.empty()
    assert rig.mesh.get_neighbours() == {}
    assert rig.events == reported
    assert (rig.tried(), rig.broadcasts(), rig.engine.goals) == ([], [], [])
    assert sum(rig.mesh.complaints.counts.values()) == 1


def test_a_flood_of_bad_input_is_one_line_in_the_log(rig, caplog):
    with caplog.at_level(logging.WARNING):
        for tenth in range(100):
            rig.mesh.on_msg(BAD["creator 255"], tenth / 10)
    assert [record.getMessage() for record in caplog.records] == [
        "node 1: dropped a packet with invalid ids: " + BAD["creator 255"].hex() + " (1 so far)"
    ]
    rig.mesh.on_msg(BAD["creator 255"], 40.0)
    assert caplog.records[-1].getMessage().endswith("(101 so far)")


@pytest.mark.parametrize("kind", ["00", "08", "7f", "80", "ff"])
def test_a_type_that_is_not_known_teaches_and_is_forwarded_but_not_processed(rig, kind):
    rig.hear(f"05 02 {kind} 01 01")
    assert rig.tried() == []
    assert rig.routing.get_direction_to_node(5) == 2
    rig.know_neighbour(9)
    rig.hear(f"05 02 {kind} 01 09 de ad be ef")
    assert rig.sent() == [packet(f"05 01 {kind} 09 09 de ad be ef")]


# Learning ------------------------------------------------------------------------------------


def test_the_sender_is_a_direct_neighbour(rig):
    rig.now_s = 2.5
    rig.hear("02 02 00 01 01")
    assert rig.routing.get_set_of_children() == {2}
    assert rig.mesh.get_neighbours() == {2: 2.5}


@pytest.mark.parametrize(
    ("heard", "next_hop", "known"),
    [
        (["05 02 00 01 09"], 2, 2),  # a packet for another node teaches as well
        (["05 02 00 01 01", "05 03 04 01 01 00 ff 01"], 3, 3),  # a heartbeat, under no other child
        (["05 03 00 01 01", "05 02 00 01 01"], 3, 3),  # another one, only while 5 is unknown
        (["05 05 00 01 01", "05 02 00 01 01"], 5, 2),  # came round: 5 remains a neighbour
    ],
)
def test_a_packet_teaches_a_route_to_its_creator(rig, heard, next_hop, known):
    rig.hear(*heard)
    assert rig.routing.get_direction_to_node(5) == next_hop
    assert rig.routing.get_table_size() == known


def test_an_own_packet_that_comes_back_does_not_teach_a_route_to_itself(rig):
    rig.hear("01 02 04 01 01 00 ff 01", "01 02 00 01 01")
    assert rig.routing.get_direction_to_node(1) == NO_ROUTE
    assert rig.routing.get_set_of_children() == {2}


def test_it_learns_first_and_then_answers(rig):
    """The first question of a new neighbour, and of a node behind it, can be answered."""
    rig.engine.place = rig.engine.place._replace(latitude=1.0)
    rig.now_s = 3.9
    rig.hear("05 02 02 01 01")
    assert rig.sent() == [packet("01 01 01 02 05 00 00 80 3f 00 00 00 00 00 00 03")]


# Forwarding ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("heard", "sent"),
    [
        (
            "05 02 06 01 09 00 00 80 3f 00 00 00 40 07",
            "05 01 06 09 09 00 00 80 3f 00 00 00 40 07",
        ),
        ("05 02 04 01 09 01 00 03", "05 01 04 09 09 01 00 04"),  # a heartbeat counts its hops
        ("05 02 00 01 08", "05 01 00 03 08"),  # 8 is behind 3
    ],
)
def test_forwarding_changes_from_and_to_alone(rig, heard, sent):
    rig.hear("08 03 00 01 01")
    rig.know_neighbour(9)
    rig.hear(heard)
    assert rig.sent() == [packet(sent)]
    assert rig.mesh.get_total_message_sent() == 1
    assert rig.engine.goals == []


def test_a_heartbeat_with_254_hops_is_dropped(rig):
    rig.know_neighbour(9)
    rig.hear("05 02 04 01 09 01 00 fd")
    assert rig.sent() == [packet("05 01 04 09 09 01 00 fe")]
    rig.hear("06 02 04 01 09 01 00 fe", "07 02 04 01 09 01 00 ff")
    assert rig.sent() == []


@pytest.mark.parametrize(
    ("neighbours", "behind", "dead", "from_", "told"),
    [
        ((2, 3, 7), (), (), 7, [(7, 9), (2, 9), (3, 9)]),
        ((2, 7), (7,), (), 7, [(7, 9), (2, 9)]),  # it is not sent back
        ((2, 3, 9), (), (9,), 3, [(3, 9), (2, 9)]),  # the only next hop fails
        ((2, 3, 4), (4,), (4,), 3, [(3, 4), (2, 4), (3, 9), (2, 9)]),  # and 9 is behind it
        ((2, 3, 9), (3,), (9,), 3, [(3, 9), (2, 9)]),  # the sender alone might have led there
    ],
)
def test_without_a_route_the_neighbours_are_informed_once_the_sender_first(
    rig, neighbours, behind, dead, from_, told
):
    rig.know_neighbour(*neighbours)
    for child in behind:
        rig.routing.other_can_communicate_with_node(child, 9)
    rig.antenna.dead = set(dead)
    rig.hear(f"05 0{from_} 7f 01 09")
    assert rig.sent() == [packet(f"01 01 05 0{to} 0{to} 0{lost}") for to, lost in told]
    assert rig.routing.get_direction_to_node(9) in (NO_ROUTE, from_)


def test_when_the_next_hop_does_not_take_it_one_other_route_is_tried(rig):
    rig.hear("09 03 00 01 01")
    rig.routing.other_can_communicate_with_node(4, 9)
    rig.antenna.dead = {3}
    rig.hear("05 02 7f 01 09")
    assert rig.tried(0x7F) == [packet("05 01 7f 03 09")] * 3 + [packet("05 01 7f 04 09")]
    assert rig.routing.get_direction_to_node(9) == 4


def test_after_two_routes_that_do_not_take_it_it_is_dropped(rig):
    for child in (3, 4, 6):
        rig.routing.other_can_communicate_with_node(child, 9)
    rig.antenna.gets_lost = lambda payload: payload[2] == 0x7F and payload[3] in (3, 4)
    rig.hear("05 02 7f 01 09")
    assert rig.tried(0x7F) == [packet("05 01 7f 03 09")] * 3 + [packet("05 01 7f 04 09")] * 3
    assert rig.routing.get_direction_to_node(9) == 6


# Orders that go no further -------------------------------------------------------------------


def stranded(rig):
    """Whether the rig reported, once, an order for drone 9 that ends here."""
    peers = [event.peer for event in rig.events if event.kind.name == "NO_ROUTE"]
    assert rig.mesh.complaints.counts["no route to drone 9"] == len(peers)
    return peers == [9]


@pytest.mark.parametrize("circulates", [False, True])
def test_an_order_without_a_route_or_that_circulates_ends_here_and_is_reported(rig, circulates):
    rig.know_neighbour(3)
    if circulates:
        rig.know_neighbour(9)
        rig.hear("00 02 06 01 09")
        assert not stranded(rig)
    rig.hear("00 03 06 01 09")
    assert stranded(rig)


def test_an_order_that_two_next_hops_do_not_take_ends_here_and_is_reported(rig):
    for child in (4, 6, 7):
        rig.routing.other_can_communicate_with_node(child, 9)
    rig.antenna.gets_lost = lambda payload: payload[2] == 6
    rig.hear("00 03 06 01 09")
    assert stranded(rig)


# Circulating packets ------------------------------------------------------------------------


def test_a_packet_that_it_made_itself_is_not_forwarded_and_its_entry_forgotten(rig):
    rig.hear("09 03 00 01 01")
    rig.know_neighbour(2)
    rig.mesh.control.send_heartbeat(9)
    (sent,) = rig.sent(4)
    assert sent[3] == 3
    rig.hear("01 02 04 01 09 00 ff 02")  # the same packet, two hops later
    assert rig.sent() == []
    assert rig.routing.get_direction_to_node(9) == NO_ROUTE
    assert rig.routing.get_set_of_children() == {2, 3}


def test_another_radio_with_its_id_is_named_and_shown_that_the_id_is_in_use(rig, caplog):
    rig.connect_to_gateway()
    rig.wait(11.0)
    caplog.clear()
    rig.antenna.broadcasts.clear()
    for _ in range(5):
        rig.hear("01 01 03 01 fe ff 00")
    assert [record.getMessage() for record in caplog.records] == [
        "node 1: another radio uses id 1: give each node its own (1 so far)"
    ]
    assert rig.mesh.get_shares_id()
    rig.wait(3.0)
    assert [payload[2] for payload in rig.broadcasts()] == [3, 3, 3]
    rig.wait(61.0)
    assert not rig.mesh.get_shares_id()
    assert rig.antenna.switched == []


DATA_FOR_9_BY_2 = "05 02 80 01 09 2a"
NOT_SENT = "dropped a packet in this node's name that it did not send"


@pytest.mark.parametrize("forged", ["01 02 80 01 09", "01 02 04 01 09 01 00 02", "01 02 06 01 09"])
def test_a_packet_in_its_name_that_it_did_not_send_says_nothing_about_a_route(rig, forged):
    rig.wait(61.0)
    rig.hear("09 03 00 01 01")
    rig.know_neighbour(2)
    rig.hear(forged)
    assert rig.sent(int(forged[6:8], 16)) == []
    assert rig.routing.get_direction_to_node(9) == 3
    assert NOT_SENT in rig.mesh.complaints.counts


def test_its_own_packet_that_comes_back_after_seconds_is_no_forgery_nor_news_of_a_route(rig):
    rig.wait(61.0)
    rig.hear("09 03 00 01 01")
    rig.know_neighbour(2)
    rig.mesh.control.send_heartbeat(9)
    rig.wait(5.5)
    rig.hear("01 02 04 01 09 00 ff 02")
    assert rig.routing.get_direction_to_node(9) == 3
    assert NOT_SENT not in rig.mesh.complaints.counts


def test_its_own_bid_that_a_neighbour_passes_on_through_it_is_no_forgery(rig):
    rig.wait(61.0)
    rig.hear("09 03 00 01 01")
    rig.know_neighbour(2)
    rig.hear("01 02 07 01 09 00 00 82 41")  # 2 takes this node for its way to its neighbour 9
    assert rig.sent(7) == []
    assert NOT_SENT not in rig.mesh.complaints.counts


def test_what_comes_back_to_a_restarted_node_is_no_forgery(rig):
    rig.hear("09 03 00 01 01")
    rig.know_neighbour(2)
    rig.hear("01 02 06 01 09")
    assert rig.sent() == []
    assert NOT_SENT not in rig.mesh.complaints.counts


def test_a_direct_neighbour_is_never_forgotten_for_a_packet_that_goes_round(rig):
    rig.know_neighbour(9)
    rig.hear("01 02 41 01 09")
    rig.hear("05 02 41 01 09", "05 03 41 01 09")
    assert rig.sent() == [packet("05 01 41 09 09")]
    assert rig.routing.get_direction_to_node(9) == 9


def test_the_same_packet_from_another_neighbour_is_dropped_and_its_entry_forgotten(rig):
    rig.hear("09 03 00 01 01")
    rig.hear("05 02 41 01 09 2a")
    rig.wait(0.4)
    rig.hear("05 04 41 01 09 2a")
    assert rig.sent() == [packet("05 01 41 03 09 2a")]
    assert rig.routing.get_direction_to_node(9) == NO_ROUTE
    assert rig.routing.get_set_of_children() == {2, 3, 4}


@pytest.mark.parametrize(
    ("first", "second"),
    [
        (DATA_FOR_9_BY_2, "05 02 80 01 09 2a"),  # the same neighbour again
        (DATA_FOR_9_BY_2, "06 04 80 01 09 2a"),  # another creator
        (DATA_FOR_9_BY_2, "05 04 81 01 09 2a"),  # another type
        (DATA_FOR_9_BY_2, "05 04 80 01 09 2b"),  # another body
        (DATA_FOR_9_BY_2, "05 05 80 01 09 2a"),  # straight from its creator
        ("05 02 04 01 09 00 ff 01", "05 05 04 01 09 00 ff 00"),
        ("05 02 04 01 09 00 ff 01", "05 04 04 01 09 00 ff 01"),  # a detour: bounded by its hops
        ("05 02 04 01 09 00 ff 01", "05 04 04 01 09 00 ff 03"),
    ],
)
def test_a_packet_that_differs_or_was_sent_again_is_forwarded(rig, first, second):
    rig.hear("06 06 00 01 01", "09 03 00 01 01", first, second)
    assert len([sent for sent in rig.sent() if sent[2] != 5]) == 2
    assert rig.routing.get_direction_to_node(9) == 3
    assert not any("circulates" in reason for reason in rig.mesh.complaints.counts)


TWICE = ("05 03 40 01 00 21 00 01", "05 04 40 01 00 21 00 01")  # a reply of 5 to gateway 0


@pytest.mark.parametrize("medium", [UNDISTURBED, Medium(policy=QUEUED)])
def test_a_router_whose_only_way_up_seems_to_lead_in_a_circle_looks_for_another_one_at_once(medium):
    rig = Rig(medium=medium)
    rig.connect_through(2)
    rig.know_neighbour(3, 4)
    rig.hear(*TWICE)
    assert rig.mesh.get_route_to_gateway() == NO_ROUTE
    assert not rig.mesh.get_connected_to_gateway()
    assert [present[6] for present in rig.broadcasts() if present[2] == 3] == [0]


def test_on_a_shared_channel_it_tries_a_neighbour_that_said_that_it_has_a_gateway():
    rig = Rig(medium=Medium(policy=QUEUED))
    rig.connect_through(2)
    rig.hear("04 04 00 01 01", "03 03 03 01 fe 01 01")
    rig.hear(*TWICE)
    assert rig.mesh.get_route_to_gateway() == 3
    assert [sent[3] for sent in rig.sent(4) if sent[4] == 0] == [3]


def test_the_same_packet_from_another_neighbour_is_forwarded_after_half_a_second(rig):
    rig.hear("09 03 00 01 01", "05 02 80 01 09 2a")
    rig.wait(0.51)
    rig.hear("05 04 80 01 09 2a")
    assert rig.sent() == [packet("05 01 80 03 09 2a"), packet("05 01 80 03 09 2a")]


def test_the_half_second_counts_from_the_first_time(rig):
    rig.hear("09 03 00 01 01", "05 02 80 01 09 2a")
    rig.wait(0.3)
    rig.hear("05 02 80 01 09 2a")
    rig.wait(0.3)
    rig.hear("05 04 80 01 09 2a")
    assert len(rig.sent()) == 3


def test_the_entry_that_is_forgotten_is_the_one_that_was_used_in_the_end(rig):
    """The first next hop did not take the packet: what went round went by the second."""
    rig.hear("09 03 00 01 01")
    for child in (4, 6):
        rig.routing.other_can_communicate_with_node(child, 9)
    rig.antenna.dead = {3}
    rig.hear("05 02 41 01 09", "05 07 41 01 09")
    assert rig.sent(0x41) == [packet("05 01 41 04 09")]
    assert rig.routing.get_direction_to_node(9) == 6


def test_a_heartbeat_that_comes_round_with_more_hops_is_dropped_and_its_route_forgotten(rig):
    rig.hear("06 06 00 01 01", "09 03 00 01 01")
    rig.hear("05 02 04 01 09 00 ff 01", "05 04 04 01 09 00 ff 04")
    assert rig.sent(4) == [packet("05 01 04 03 09 00 ff 02")]
    assert rig.routing.get_direction_to_node(9) == 255


# Anything at all -----------------------------------------------------------------------------


@pytest.mark.parametrize("gateway", [False, True], ids=["router", "gateway"])
def test_thousands_of_random_packets_raise_nothing_and_the_node_still_answers(gateway):
    rig = Rig(gateway=gateway)
    rng = random.Random(14)
    for number in range(4000):
        payload = bytearray(rng.getrandbits(256).to_bytes(32, "little"))
        if number % 2:  # a good header, to this node
            payload[0], payload[1], payload[3] = rng.randrange(254), rng.randrange(2, 254), 1
            payload[2] = rng.choice([0, 1, 2, 3, 4, 5, 7, rng.randrange(8, 256)])
            payload[4] = rng.choice([1, 254, rng.randrange(255)])
        elif payload[2] == 6:
            continue  # orders to move are left out
        if number % 50 == 0:
            rig.antenna.dead = set(rng.sample(range(254), 5))
            rig.wait(1.0)
        rig.mesh.on_msg(bytes(payload), rig.now_s)
    rig.antenna.dead = set()
    rig.know_neighbour(5)
    rig.hear("05 05 02 01 01")
    assert [p[:5] for p in rig.sent(1)] == [bytes((1, 1, 1, 5, 5))]
    rig.wait(300.0)
    rig.hear("05 05 02 01 01")
    assert [p[:5] for p in rig.sent(1)][-1] == bytes((1, 1, 1, 5, 5))


# Users' data for nodes without a route --------------------------------------------------------

DATA_FOR_9 = "05 03 80 01 09 00 ab cd"


def below_the_gateway():
    """Router 1: gateway 0 is reached through 2; 3 is another neighbour."""
    rig = Rig()
    rig.connect_through(2)
    rig.know_neighbour(3)
    return rig


def test_data_for_an_unknown_node_goes_to_the_next_hop_to_the_gateway_and_nothing_else_does():
    rig = below_the_gateway()
    rig.hear(DATA_FOR_9)
    assert rig.sent() == [packet("05 01 80 02 09 00 ab cd")]
    rig.hear("05 03 01 01 09")
    assert rig.sent(1) == []


def test_data_that_comes_down_from_there_goes_back_once_so_that_the_next_hop_learns():
    rig = below_the_gateway()
    rig.hear("05 02 80 01 09 00 ab cd")
    assert rig.sent() == [packet("05 01 80 02 09 00 ab cd")]
    rig.forget()
    rig.hear("05 02 80 01 09 00 ab cd")
    assert rig.sent(0x80) == []


def test_a_neighbour_that_sends_data_for_a_node_behind_it_does_not_lead_there():
    rig = below_the_gateway()
    rig.routing.other_can_communicate_with_node(3, 9)
    rig.hear(DATA_FOR_9)
    assert rig.sent() == [packet("05 01 80 02 09 00 ab cd")]
    assert rig.routing.get_direction_to_node(9) == NO_ROUTE


def test_data_that_comes_round_goes_back_on_its_way_to_where_it_came_from_first_and_ends():
    rig = below_the_gateway()
    came_from, back_to = [3, 4, 2, 2, 2], []
    for neighbour in came_from:
        rig.forget()
        rig.hear(f"05 {neighbour:02x} 80 01 09 00 ab cd")
        back_to.append([sent[3] for sent in rig.sent(0x80)])
    assert back_to == [[2], [4], [3], [3], []]


def test_data_that_came_round_goes_back_to_the_neighbour_that_it_came_from_each_time():
    """So the nodes of each loop learn, not those of the first one only."""
    rig = below_the_gateway()
    rig.know_neighbour(4, 6)
    rig.routing.other_can_communicate_with_node(4, 9)
    sent_to = []
    for neighbour in (3, 4, 6):  # 4 does not lead to 9, and the way up comes back through 6
        rig.forget()
        rig.hear(f"05 {neighbour:02x} 80 01 09 00 ab cd")
        sent_to += [sent[3] for sent in rig.sent(0x80)]
    assert sent_to == [4, 2, 6]


@pytest.mark.parametrize(
    ("pause_s", "goes_to"), [(0.4, [4, 4, 4, 2, 2, 2]), (0.6, [4, 4, 4, 4, 4, 4])]
)
def test_data_that_a_neighbour_sends_again_within_half_a_second_circulates_on_a_shared_channel(
    pause_s, goes_to
):
    """A loop that none of its nodes remembers to have entered: the last entry was too long ago."""
    rig = Rig(medium=Medium(policy=QUEUED))
    rig.connect_through(2)
    rig.know_neighbour(3, 4)
    rig.routing.other_can_communicate_with_node(4, 9)
    sent_to = []
    for _ in goes_to:
        rig.forget()
        rig.hear(DATA_FOR_9)
        sent_to += [sent[3] for sent in rig.sent(0x80)]
        rig.wait(pause_s)
    assert sent_to == goes_to
    assert rig.routing.get_direction_to_node(9) == (4 if 2 not in goes_to else NO_ROUTE)


def test_if_the_hop_down_does_not_take_it_the_gateway_gets_it():
    rig = below_the_gateway()
    rig.know_neighbour(9)
    rig.antenna.dead = {9}
    rig.hear(DATA_FOR_9)
    assert rig.sent(0x80) == [packet("05 01 80 02 09 00 ab cd")]


def test_a_gateway_that_knows_no_such_node_tells_the_creator_and_searches_for_it_ever_more_rarely():
    rig = Rig(gateway=True)
    rig.know_neighbour(3)
    searches = []
    for _ in range(40):
        rig.hear(DATA_FOR_9)
        searches.append(len([p for p in rig.broadcasts() if p[2] == 0x44]))
        rig.wait(0.5)
    assert rig.sent(5)[0] == packet("01 01 05 03 05 09")
    assert [0.5 * at for at, one in enumerate(searches) if one] == [0.0, 1.0, 3.0, 7.0, 15.0]
    assert rig.mesh.complaints.counts["no route to node 9"] > 0


@pytest.mark.parametrize(("found_after_s", "sent_on"), [(3.9, 64), (4.1, 0)])
def test_a_gateway_keeps_the_last_64_packets_for_4_s_while_it_searches(found_after_s, sent_on):
    rig = Rig(gateway=True)
    rig.know_neighbour(3)
    for number in range(70):
        rig.hear(f"05 03 80 01 09 00 {number:02x} cd")
    rig.wait(found_after_s)
    rig.hear("09 03 04 01 01 00 ff 01")
    sent = rig.sent(0x80)
    assert [one[6] for one in sent] == list(range(70))[70 - sent_on :]
    assert all(one.startswith(bytes.fromhex("05 01 80 03 09")) for one in sent)


def test_a_gateway_that_has_lost_its_internet_sends_it_on_to_another_gateway():
    rig = Rig(gateway=True)
    rig.mesh.set_internet(False, rig.now_s)
    rig.connect_through(2)
    rig.hear(DATA_FOR_9)
    assert rig.sent(0x80) == [packet("05 01 80 02 09 00 ab cd")]


# Another radio with the same id -----------------------------------------------------------------


def test_a_new_node_shows_itself_to_another_one_with_its_id_and_gives_way_if_that_is_connected():
    rig, connected_1 = Rig(), "01 01 03 01 fe 01 01"
    rig.hear(connected_1)
    assert (rig.broadcasts(), rig.antenna.switched) == ([packet("01 01 03 fe fe ff")], [])
    rig.hear("01 01 03 01 fe ff 00")
    assert rig.antenna.switched == []
    rig.hear(connected_1)
    assert rig.antenna.switched == [False]
    rig.wait_until(44.9)
    assert rig.antenna.switched == [False]
    rig.connect_to_gateway()
    rig.wait_until(55.0)
    rig.hear(connected_1, connected_1)  # by now the mesh knows this one
    assert rig.antenna.switched == [False, True]
