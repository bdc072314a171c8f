from __future__ import annotations

import random

import pytest
from seal_rig import KEY, packet

from drone_mesh.communication.seals.end_to_end import EndToEnd, Expired, NotProven

ORDER = packet("00 00 06 01 05 00 00 80 3f 00 00 00 40 03 00 2a 00")  # numbered 42, to drone 5
PRESENT = packet("05 05 03 fe fe ff 00")
REQUEST = packet("05 05 02 01 00")
LOCATION = packet("00 00 01 01 05 00 00 80 3f 00 00 00 40 03 00 00 00 00 01")
ANSWER = packet("00 00 04 01 05 01 00 00")  # heartbeat of gateway 0


def end(node_id, keys=KEY, seed=0):
    return EndToEnd(node_id, keys, random.Random(f"{node_id} {seed}"))


@pytest.fixture
def pair():
    """Gateway 0 and drone 5, whose PRESENT the gateway heard."""
    gateway, drone = end(0), end(5, KEY.for_node(5))
    gateway.open(drone.seal(PRESENT, 0.0))
    return gateway, drone


def relayed(payload, from_=3, to=5):
    return payload[:1] + bytes((from_,)) + payload[2:3] + bytes((to,)) + payload[4:]


@pytest.mark.parametrize("made", [ORDER, LOCATION, ANSWER], ids=["order", "place", "heartbeat"])
def test_a_gateways_packet_is_accepted_once(pair, made):
    gateway, drone = pair
    sealed = relayed(gateway.seal(made, 0.0))
    assert drone.open(sealed) == relayed(made)
    with pytest.raises(NotProven, match="replayed"):
        drone.open(sealed)


def test_a_proof_stands_before_the_hop_seal(pair):
    gateway, _ = pair
    sealed = gateway.seal(ORDER, 0.0)
    assert sealed[:17] == ORDER[:17]
    assert sealed[17:25] != bytes(8)
    assert sealed[25:] == bytes(7)
    assert gateway.seal(LOCATION, 0.0)[:19] == LOCATION[:19]


@pytest.mark.parametrize(
    ("made", "end_of_body"),
    [
        (ORDER, "2a 00 94 e8 3b 09 80 ee ff 40"),
        (LOCATION, "00 00 00 01 ef 67 07 f5 ff 40"),
        (ANSWER, "3f 6c cb 59 44 9a ab d9 ff 40"),
    ],
    ids=["order", "place", "heartbeat"],
)
def test_a_proven_packet_has_these_bytes_on_the_air(pair, made, end_of_body):
    gateway, _ = pair
    sealed = gateway.seal(made, 0.0)
    assert sealed[:15] == made[:15]
    assert sealed[15:25] == bytes.fromhex(end_of_body)
    assert sealed[25:] == bytes(7)


@pytest.mark.parametrize("byte", [0, 2, 4, *range(5, 25)])
def test_no_changed_byte_of_an_order_goes_unnoticed(pair, byte):
    gateway, drone = pair
    changed = bytearray(gateway.seal(ORDER, 0.0))
    changed[byte] ^= 1
    assert drone.open(gateway.seal(ORDER, 0.0))
    if changed[4] == 5 and changed[2] == 6:
        with pytest.raises(NotProven, match="an order without proof"):
            drone.open(bytes(changed))
    elif changed[4] == 5:
        assert drone.open(bytes(changed))[2] != 6


def test_a_captured_router_cannot_order_others(pair):
    _, drone = pair
    captured = end(7, KEY.for_node(7))
    captured.open(drone.seal(PRESENT, 0.0))
    order = packet("07 07 06 05 05 00 00 80 3f 00 00 00 40 03 00")
    with pytest.raises(NotProven, match="an order without proof"):
        drone.open(captured.seal(order, 0.0))
    as_gateway = packet("00 07 06 05 05 00 00 80 3f 00 00 00 40 03 00")
    with pytest.raises(NotProven, match="an order without proof"):
        drone.open(captured.seal(as_gateway, 0.0))


def test_a_captured_router_cannot_pose_as_a_gateway(pair):
    _, drone = pair
    captured = end(7, KEY.for_node(7))
    captured.open(drone.seal(PRESENT, 0.0))
    with pytest.raises(NotProven, match="without the proof of a gateway"):
        drone.open(captured.seal(packet("07 07 04 05 05 01 07 00"), 0.0))


def test_an_order_is_invalid_after_a_restart_of_its_drone(pair):
    gateway, _ = pair
    recorded = gateway.seal(ORDER, 0.0)
    restarted = end(5, KEY.for_node(5), seed=1)
    with pytest.raises(NotProven):
        restarted.open(recorded)


def test_an_order_outlives_only_the_next_two_nonces(pair):
    gateway, drone = pair
    kept = [gateway.seal(ORDER, now_s) for now_s in (0.0, 1.0, 2.0)]
    heartbeat = packet("05 05 04 00 00 01 00 00")
    for now_s in (30.0, 60.0):
        drone.seal(heartbeat, now_s)
    assert drone.open(kept[0])
    drone.seal(heartbeat, 90.0)
    with pytest.raises(NotProven):
        drone.open(kept[1])


def test_an_order_that_was_long_on_its_way_is_late_and_not_forged(pair):
    """On a busy channel a drone may announce some nonces while the order waits."""
    gateway, drone = pair
    late = gateway.seal(ORDER, 0.0)
    heartbeat = packet("05 05 04 00 00 01 00 00")
    for turn in range(6):
        drone.seal(heartbeat, 30.0 + 30.0 * turn)
        if turn >= 2:
            with pytest.raises(Expired if turn < 5 else NotProven) as error:
                drone.open(late)
    assert not isinstance(error.value, Expired)


def test_the_answer_to_a_heartbeat_counts_however_many_followed_within_half_a_minute(pair):
    """On a full channel it comes later than the next heartbeats leave."""
    gateway, drone = pair
    gateway.open(relayed(drone.seal(BEAT, 10.0), to=0))
    slow = relayed(gateway.seal(ANSWER, 12.0))
    for now_s in range(14, 40, 4):
        drone.seal(BEAT, float(now_s))
    assert drone.open(slow) == relayed(ANSWER)


def test_tries_and_copies_of_a_packet_count_as_one(pair):
    gateway, drone = pair
    copies = [gateway.seal(relayed(ORDER, 0, to), 0.01 * to) for to in (1, 2, 3)]
    assert len({copy[4:] for copy in copies}) == 1
    assert drone.open(copies[0])
    again = gateway.seal(ORDER, 0.5)  # tries and copies follow at once
    assert again[4:] != copies[0][4:]
    assert drone.open(again)


def test_an_order_waits_until_its_drone_was_heard():
    gateway = end(0)
    assert gateway.seal(ORDER, 0.0) is None
    assert gateway.seal(ANSWER, 0.0)[19:] == bytes(13)  # finds the drone, and proves nothing


def test_a_request_for_a_place_carries_the_nonce_that_the_answer_needs():
    asker, answerer = end(5, KEY.for_node(5)), end(0, KEY.for_node(0))
    request = asker.seal(REQUEST, 0.0)
    assert answerer.open(request) == REQUEST
    assert asker.open(answerer.seal(LOCATION, 0.0)) == LOCATION


def test_a_broadcast_place_of_a_gateway_is_not_accepted(pair):
    gateway, drone = pair
    broadcast = packet("00 00 01 05 fe 00 00 80 3f 00 00 00 40 03 00")
    assert drone.open(broadcast) == broadcast  # node 0 might be a router
    drone.open(gateway.seal(ANSWER, 0.0))
    with pytest.raises(NotProven, match="a gateway's place"):
        drone.open(broadcast)


def test_users_data_and_bids_are_not_changed(pair):
    gateway, drone = pair
    for made in (
        packet("00 00 80 05 05")[:5] + bytes(20) + bytes(7),
        packet("00 00 07 05 05 00 00 80 3f"),
    ):
        assert drone.open(gateway.seal(made, 0.0)) == made


BEAT = packet("05 05 04 03 00 01 00 00")  # heartbeat of drone 5 to gateway 0


def beats(gateway, drone, now_s):
    """A heartbeat of the drone, and the gateway's answer."""
    gateway.open(relayed(drone.seal(BEAT, now_s), to=0))
    drone.open(relayed(gateway.seal(ANSWER, now_s)))


def test_a_nonce_that_somebody_claims_in_the_drones_name_silences_no_order(pair):
    gateway, drone = pair
    for round_ in range(24):
        now_s = 10.0 * round_
        beats(gateway, drone, now_s)
        if round_:  # the first heartbeat has no proof yet: the drone does not know the gateway
            for forger in range(10):
                gateway.open(
                    end(5, KEY.for_node(7), seed=f"{round_} {forger}").seal(PRESENT, now_s)
                )
            claimed = end(5, KEY.for_node(5), seed=round_).seal(BEAT, now_s)  # without a proof
            gateway.open(relayed(claimed, to=0))
            assert drone.open(relayed(gateway.seal(ORDER, now_s + 1.0)))


def test_a_nonce_that_was_answered_is_replaced_after_five_seconds(pair):
    gateway, drone = pair
    beats(gateway, drone, 10.0)
    kept = gateway.seal(ORDER, 11.0)
    for now_s in (15.0, 20.0, 25.0):
        beats(gateway, drone, now_s)
    with pytest.raises(Expired):
        drone.open(relayed(kept))


def test_the_proof_of_a_heartbeat_covers_its_nonce(pair):
    gateway, drone = pair
    beats(gateway, drone, 0.0)
    beats(gateway, drone, 10.0)
    changed = bytearray(relayed(drone.seal(BEAT, 20.0), to=0))
    changed[15] ^= 1
    gateway.open(bytes(changed))
    assert drone.open(relayed(gateway.seal(ORDER, 21.0)))


def test_a_restarted_drone_takes_the_second_try_of_an_order(pair):
    gateway, drone = pair
    beats(gateway, drone, 0.0)
    beats(gateway, drone, 10.0)
    restarted = end(5, KEY.for_node(5), seed=1)
    gateway.open(relayed(restarted.seal(BEAT, 20.0), to=0))
    with pytest.raises(NotProven):
        restarted.open(relayed(gateway.seal(ORDER, 21.0)))
    assert restarted.open(relayed(gateway.seal(ORDER, 23.0)))


@pytest.mark.parametrize(
    "made",
    [
        packet("00 07 06 05 fe 00 00 80 3f 00 00 00 40 03 00 2a 00"),  # an order to fly
        packet("07 07 04 05 fe 01 07 00"),  # a heartbeat of "gateway" 7
        packet("03 07 40 05 fe 2a 00 03 00"),  # a reply: drone 3 has arrived
        packet("00 07 41 05 fe 2a 00"),  # a question for an order
        packet("03 07 42 05 fe 04 01 00 00 00 00 00 00 00 05 02 0a"),  # a report: battery 5 %
        packet("03 07 43 05 fe 00"),  # and its words
        packet("07 07 7d 05 fe 01 00 00 00 00 80 3f 00 00 00 40 03 00"),  # place of a gateway
        packet("07 03 07 05 fe 00 00 c8 42"),  # a bid, for which neighbour 3 would answer
    ],
    ids=["order", "heartbeat", "reply", "query", "report", "words", "gateway's place", "bid"],
)
def test_what_needs_a_proof_is_not_accepted_as_a_broadcast_which_has_none(pair, made):
    """Any captured node has the key of broadcasts."""
    _, drone = pair
    with pytest.raises(NotProven, match="without (the )?proof"):
        drone.open(made)


@pytest.mark.parametrize("kind", ["01", "44", "45"], ids=["place", "search", "last place"])
def test_what_nodes_tell_all_their_neighbours_needs_no_proof(pair, kind):
    _, drone = pair
    made = packet(f"03 07 {kind} 05 fe 00 00 80 3f 00 00 00 40 03 00")
    assert drone.open(made) == made


RESIGNS = packet("00 00 04 01 05 00 ff 00")  # heartbeat of gateway 0, which is none now


def test_a_captured_node_cannot_say_in_a_gateways_name_that_it_is_none_now(pair):
    gateway, drone = pair
    beats(gateway, drone, 0.0)
    captured = end(7, KEY.for_node(7))
    captured.open(drone.seal(PRESENT, 0.0))
    with pytest.raises(NotProven, match="without the proof of a gateway"):
        drone.open(captured.seal(RESIGNS, 1.0))


def test_a_gateway_proves_to_those_that_know_it_that_it_is_none_now(pair):
    gateway, drone = pair
    beats(gateway, drone, 0.0)
    assert drone.open(gateway.seal(RESIGNS, 1.0)) == RESIGNS


def test_a_gateway_believes_another_one_that_is_none_now_without_a_proof():
    """It may have been restarted, and needs an answer to know the nonce for one."""
    gateway, other = end(1), end(0)
    other.open(gateway.seal(packet("01 01 03 fe fe 00 01"), 0.0))
    gateway.seal(packet("01 01 04 00 00 01 01 00"), 0.0)  # it acts as a gateway
    gateway.open(other.seal(packet("00 00 04 01 01 01 00 00"), 0.0))
    restarted = end(0, seed=1)
    beat = packet("00 00 04 01 01 00 01 00")
    assert gateway.open(restarted.seal(beat, 1.0)) == beat
