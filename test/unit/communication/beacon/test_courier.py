"""Courier: one packet, one verdict after the other."""

from __future__ import annotations

import pytest
from rig import RecordingAntenna, packet

from drone_mesh.communication.beacon.courier import DROP, HOLD, Courier, QueuedCourier
from drone_mesh.communication.timing import Deadlines, Medium

FROM_5_THROUGH_2 = "05 02 00 01 09 07"


class Node:
    """Node 1, which sends a packet to the first of its neighbours that it did not try."""

    def __init__(self, shared=False):
        self.neighbours, self.otherwise = [], HOLD
        self.taken, self.refused, self.returned = [], [], []
        self.antenna, self.deadlines = RecordingAntenna(Medium()), Deadlines()
        told = self.taken.append, self.refused.append, lambda *it: self.returned.append(it)
        self.courier = (QueuedCourier if shared else Courier)(
            1, self.antenna, self.deadlines, 2, self.verdict, *told, lambda it: it[:25] + bytes(7)
        )

    def verdict(self, transit):
        tried = {transit.came_from, *transit.sent_s, *transit.failed_s}
        return next((to for to in self.neighbours if to not in tried), self.otherwise)

    def hear(self, text, now_s=0.0):
        self.deadlines.now_s, payload = now_s, packet(text)
        self.courier.forward(payload, payload[0], payload[1], payload[2], payload[4], now_s)

    def receivers(self):
        return [sent[3] for sent in self.antenna.taken]


@pytest.fixture
def node():
    return Node()


def test_a_packet_that_a_neighbour_does_not_take_goes_to_the_next_one_at_once(node):
    node.neighbours, node.antenna.dead = [3, 4], {3}
    node.hear(FROM_5_THROUGH_2)
    assert [tried[3] for tried in node.antenna.tried] == [3, 3, 4]
    assert node.antenna.taken == [packet("05 01 00 04 09 07")]
    assert (node.refused, node.taken, node.courier.total_sent) == ([3], [4], 1)


def test_after_eight_neighbours_a_packet_is_given_up(node):
    node.neighbours = list(range(10, 30))
    node.antenna.dead = {*node.neighbours}
    assert not node.courier.send_own(packet("01 01 00 00 09"))
    assert len(node.refused) == 8


def test_a_packet_without_a_next_hop_waits_until_there_is_one(node):
    assert node.courier.send_own(packet("01 01 04 00 09 01 09"))
    node.hear("01 02 04 00 09 01 09 05")  # it came back
    node.courier.retry()
    assert [transit.addressee for transit in node.courier.holds] == [9]
    node.neighbours = [3]
    node.courier.retry()
    assert node.antenna.taken == [packet("01 01 04 03 09 01 09")]
    assert node.courier.holds == []


def test_at_most_sixty_four_packets_wait_and_one_that_is_to_be_dropped_does_not(node):
    assert [node.courier.send_own(packet(f"01 01 00 00 {to:02x}")) for to in range(2, 67)] == [
        *64 * [True],
        False,
    ]
    node.otherwise = DROP
    node.courier.retry()
    assert node.courier.holds == []
    assert not node.courier.send_own(packet("01 01 00 00 43"))


@pytest.mark.parametrize(("again_s", "sent"), [(0.49, [3]), (0.5, [3, 3]), (3.0, [3, 3])])
def test_a_packet_that_comes_again_from_the_same_neighbour_is_a_copy_for_half_a_second(
    node, again_s, sent
):
    node.neighbours = [3]
    node.hear(FROM_5_THROUGH_2)
    node.hear(FROM_5_THROUGH_2, again_s)
    assert node.receivers() == sent


def test_a_packet_that_comes_back_over_a_detour_goes_another_way(node):
    node.neighbours = [3, 4, 5]
    node.hear(FROM_5_THROUGH_2)
    node.hear("05 04 00 01 09 07", 0.1)
    assert node.receivers() == [3, 5]
    assert node.returned == [(4, 9)]


def test_a_packet_that_comes_round_after_it_went_back_goes_back_to_who_brought_it(node):
    """It waited here for ever: its creator, which can search everywhere, never had it again."""
    node.neighbours = [3]
    node.hear(FROM_5_THROUGH_2)
    node.hear("05 03 00 01 09 07", 0.1)
    (transit,) = node.courier.holds
    node.otherwise = transit.came_from
    node.courier.retry()
    node.otherwise = HOLD
    node.hear("05 04 00 01 09 07", 0.8)
    assert node.receivers() == [3, 2]
    assert transit.came_from == 4
    assert 4 not in transit.sent_s


@pytest.mark.parametrize(
    ("kind", "comes", "leaves", "comes_back"),
    [("04", "01 09 01", "01 09 02", "01 09 06"), ("c2", "07 07", "07 07 01 01", "07 07 02 01 03")],
    ids=["heartbeat", "route record"],
)
def test_what_relays_change_makes_no_other_packet(node, kind, comes, leaves, comes_back):
    node.neighbours = [3, 4]
    node.hear(f"05 02 {kind} 01 09 {comes}")
    node.hear(f"05 03 {kind} 01 09 {comes_back}", 0.1)
    assert node.antenna.taken == [packet(f"05 01 {kind} 0{to} 09 {leaves}") for to in (3, 4)]


@pytest.mark.parametrize(("back_s", "sent"), [(4.9, [4]), (5.0, [])])
def test_an_own_packet_that_comes_back_sealed_after_three_seconds_ends_here(node, back_s, sent):
    node.neighbours = [3, 4]
    for node.deadlines.now_s, to in ((0.0, "07"), (2.0, "09"), (3.0, "08")):
        node.courier.send_own(packet(f"01 01 00 00 {to}"))
    node.hear("01 03 00 01 09" + 20 * "00" + 7 * "aa", back_s)
    assert node.receivers() == [3, 3, 3, *sent]


def test_a_queue_that_had_room_tells_later_what_it_did_not_deliver_which_then_goes_another_way():
    node = Node(shared=True)
    node.neighbours, node.antenna.losing = [2, 3, 4], 1
    node.courier.send_own(packet("01 01 00 00 09"))
    assert [tried[3] for tried in node.antenna.tried] == [2, 3]
    assert node.taken == node.refused == []
    node.courier.undelivered(node.antenna.taken[0])
    assert (node.receivers(), node.refused, node.courier.total_sent) == ([3, 4], [3], 1)
    for sent in node.antenna.taken[1:] * 2:
        node.courier.undelivered(sent)
    assert [transit.sent_s for transit in node.courier.holds] == [{}]
