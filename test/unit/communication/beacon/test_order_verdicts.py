"""Verdicts: which neighbour takes an order."""

from __future__ import annotations

import pytest

from drone_mesh.communication.beacon.courier import Transit
from drone_mesh.communication.beacon.packets import NO_ANCESTORS, Beacon
from drone_mesh.communication.beacon.routes import BeaconRoutes
from drone_mesh.communication.beacon.search import Searches
from drone_mesh.communication.beacon.verdicts import SUSPECTED_S, Verdicts
from drone_mesh.communication.interfaces import NO_ROUTE
from drone_mesh.communication.timing.deadlines import Deadlines
from drone_mesh.communication.wire import messages
from drone_mesh.communication.wire.packet_types import MessageType

GATEWAY, LIAR, RELAY, DRONE = 0, 1, 2, 9


class Sender:
    """A gateway with two neighbours that say to hear the drone; the liar said it last."""

    def __init__(self):
        self.deadlines = Deadlines()
        self.routes = BeaconRoutes(GATEWAY, True, 10.0, lambda _node: None, shared=False)
        searches = Searches(GATEWAY, self.routes, lambda *_packet: None, 0.002)
        self.verdicts = Verdicts(self.routes, searches, self.deadlines)
        self.claim()

    def claim(self):
        for node, ago_s in ((RELAY, 0.1), (LIAR, 0.0)):
            self.routes.now_s = self.deadlines.now_s - ago_s
            near = Beacon(GATEWAY, 1, 1, GATEWAY, NO_ANCESTORS, 2.0, near=(DRONE,))
            self.routes.heard(node, near)

    def next_hop(self, after_s=0.0, kind=MessageType.MOVE_TO_LOCATION, came_from=NO_ROUTE):
        self.deadlines.now_s += after_s
        self.claim()
        packet = messages.packet(kind, GATEWAY, GATEWAY, NO_ROUTE, DRONE)
        return self.verdicts.verdict_on(Transit(packet, came_from, self.deadlines.now_s))


@pytest.mark.parametrize("came_from", [NO_ROUTE, 7], ids=["made here", "of another node"])
def test_an_order_without_an_answer_goes_another_way_the_next_time(came_from):
    sender = Sender()
    tries = [sender.next_hop(after_s=2.0, came_from=came_from) for _ in range(4)]
    assert tries == [LIAR, RELAY, LIAR, RELAY]


def test_a_drone_that_was_heard_since_its_last_order_is_ordered_the_same_way():
    sender = Sender()
    assert sender.next_hop() == LIAR
    sender.routes.now_s += 1.0
    sender.routes.led_to(DRONE, RELAY)
    assert sender.next_hop(after_s=5.0) == LIAR


def test_nobody_is_suspected_for_longer_than_the_order_is_repeated():
    sender = Sender()
    assert sender.next_hop() == LIAR
    assert sender.next_hop(after_s=SUSPECTED_S + 1.0) == LIAR


def test_packets_that_are_no_orders_go_the_best_way():
    sender = Sender()
    assert [sender.next_hop(2.0, MessageType.REQUESTLOCATION) for _ in range(2)] == [LIAR, LIAR]
