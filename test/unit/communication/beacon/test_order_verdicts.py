"""Verdicts: which neighbour takes an order, or a question of users' data."""

from __future__ import annotations

import pytest

from drone_mesh.communication.beacon.courier import Transit
from drone_mesh.communication.beacon.packets import NO_ANCESTORS, Beacon
from drone_mesh.communication.beacon.routes import BeaconRoutes
from drone_mesh.communication.beacon.verdicts import SUSPECTED_S, Searches, Verdicts
from drone_mesh.communication.interfaces import NO_ROUTE
from drone_mesh.communication.timing import Deadlines
from drone_mesh.communication.wire import messages
from drone_mesh.communication.wire.packet_types import MessageType

GATEWAY, LIAR, RELAY, DRONE = 0, 1, 2, 9
DRONES = (DRONE, 10, 11, 12)
POLL, LAST_OF_TRAIN = b"\1\0\5\0\0\0", b"\1\0\0\0\0\0"  # session, nonce, message, checksum


class Sender:
    """A gateway with two neighbours that say to hear the drone; the liar said it last."""

    def __init__(self):
        self.deadlines = Deadlines()
        self.routes = BeaconRoutes(
            GATEWAY, True, 10.0, lambda _node: None, shared=False, clock=self.deadlines
        )
        searches = Searches(GATEWAY, self.routes, lambda *_packet: None, 0.002)
        self.verdicts = Verdicts(self.routes, searches, self.deadlines)
        self.claim()

    def claim(self):
        for node, ago_s in ((RELAY, 0.1), (LIAR, 0.0)):
            self.routes.clock.now_s = self.deadlines.now_s - ago_s
            near = Beacon(GATEWAY, 1, 1, GATEWAY, NO_ANCESTORS, 2.0, near=DRONES)
            self.routes.heard(node, near)

    def next_hop(
        self, after_s=0.0, kind=MessageType.MOVE_TO_LOCATION, came_from=NO_ROUTE, to=DRONE, body=b""
    ):
        self.deadlines.now_s += after_s
        self.claim()
        packet = messages.packet(kind, GATEWAY, GATEWAY, NO_ROUTE, to, body)
        return self.verdicts.verdict_on(Transit(packet, came_from, self.deadlines.now_s))


@pytest.mark.parametrize("came_from", [NO_ROUTE, 7], ids=["made here", "of another node"])
def test_an_order_without_an_answer_goes_another_way_the_next_time(came_from):
    sender = Sender()
    tries = [sender.next_hop(after_s=2.0, came_from=came_from) for _ in range(4)]
    assert tries == [LIAR, RELAY, LIAR, RELAY]


def test_a_drone_that_was_heard_since_its_last_order_is_ordered_the_same_way():
    sender = Sender()
    assert sender.next_hop() == LIAR
    sender.routes.clock.now_s += 1.0
    sender.routes.led_to(DRONE, RELAY)
    assert sender.next_hop(after_s=5.0) == LIAR


def test_nobody_is_suspected_for_longer_than_the_order_is_repeated():
    sender = Sender()
    assert sender.next_hop() == LIAR
    assert sender.next_hop(after_s=SUSPECTED_S + 1.0) == LIAR


def test_packets_that_are_no_orders_go_the_best_way():
    sender = Sender()
    assert [sender.next_hop(2.0, MessageType.REQUESTLOCATION) for _ in range(2)] == [LIAR, LIAR]


def test_a_poll_without_an_answer_goes_another_way_too_but_not_one_that_wants_none():
    sender = Sender()
    assert [sender.next_hop(2.0, 193, body=POLL) for _ in range(2)] == [LIAR, RELAY]
    sender = Sender()
    assert [sender.next_hop(2.0, 193, body=LAST_OF_TRAIN) for _ in range(2)] == [LIAR, LIAR]


def unanswered(sender, drones):
    for drone in drones:
        assert sender.next_hop(to=drone) == LIAR
        assert sender.next_hop(after_s=2.0, to=drone) == RELAY


def test_a_neighbour_through_which_three_nodes_gave_no_answer_takes_no_packet_of_any_kind():
    sender = Sender()
    unanswered(sender, DRONES[:2])
    assert sender.next_hop(kind=MessageType.REQUESTLOCATION, to=12) == LIAR
    unanswered(sender, DRONES[2:3])
    assert sender.next_hop(kind=MessageType.REQUESTLOCATION, to=12) == RELAY
    assert sender.next_hop(kind=MessageType.REQUESTLOCATION, to=LIAR) == LIAR


def test_until_a_packet_of_another_node_comes_through_it():
    sender = Sender()
    unanswered(sender, DRONES[:3])
    sender.routes.led_to(12, LIAR)
    sender.deadlines.now_s += 5.0  # that it came from there is no hint any more
    assert sender.next_hop(kind=MessageType.REQUESTLOCATION, to=12) == LIAR


def test_it_is_used_where_there_is_no_other_way():
    sender = Sender()
    unanswered(sender, DRONES[:3])
    del sender.routes.neighbours[RELAY]
    ways = list(sender.routes.next_hops(12, NO_ROUTE))
    assert [way.neighbour for way in ways] == [LIAR]
