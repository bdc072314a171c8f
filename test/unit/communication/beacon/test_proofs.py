"""Proofs: node 9, whose mesh has a key, and its gateway 0 tell each other their nonces."""

from __future__ import annotations

import math
from types import SimpleNamespace

import pytest
from rig import AlwaysHalf, RecordingAntenna, packet

from drone_mesh.communication.beacon.connection import Proofs
from drone_mesh.communication.beacon.courier import DROP, Courier
from drone_mesh.communication.beacon.packets import NO_ANCESTORS, Beacon
from drone_mesh.communication.beacon.routes import BeaconRoutes
from drone_mesh.communication.control.places import KnownPlaces, PlaceRequests
from drone_mesh.communication.events.complaints import Complaints
from drone_mesh.communication.timing import Deadlines
from drone_mesh.drone.location import Location

TO_GATEWAY = packet("09 09 04 01 00 01 00")
ASKS = packet("09 09 02 01 00 00 00 00 00 00 00 00 00 01")
ANSWER = packet("00 01 04 09 09 01 00")
FROM_ROUTER_5 = packet("05 01 04 09 09 01 09")


class Node:
    """Sends all packets to its neighbour 1; AlwaysHalf: what is due within 5 s is due in 2.5 s."""

    def __init__(self, is_gateway=False, has_key=True):
        self.antenna, self.proved = RecordingAntenna(), set()
        self.routes = BeaconRoutes(
            9, is_gateway, 10.0, lambda _node: None, one_loss_counts=True, clock=Deadlines()
        )
        courier = Courier(
            9, self.antenna, Deadlines(), 1, lambda transit: DROP if transit.sent_s else 1,
            *3 * [lambda *_: None], lambda payload: payload,
        )  # fmt: skip
        self.complaints, self.places = Complaints(9), KnownPlaces()
        pilot = SimpleNamespace(destination=None, place=lambda: Location(0.0, 0.0, 0.0))
        requests = PlaceRequests(9, pilot, self.antenna, courier, Deadlines())
        seals = SimpleNamespace(may_be_gateway=self.proved.__contains__, has_key=has_key)
        self.proofs = Proofs(
            9, is_gateway, self.routes, courier, requests, self.places, seals,
            self.complaints, self.antenna, AlwaysHalf(),
        )  # fmt: skip

    def hears(self, *neighbours, number=5):
        """Each one hop from the gateway."""
        for neighbour in neighbours:
            self.routes.heard(neighbour, Beacon(0, number, 1, 0, NO_ANCESTORS, 1.0))
        self.routes.choose()

    def connect(self):
        self.hears(1)
        self.proofs.connected()

    def sent(self, now_s):
        self.routes.clock.now_s = now_s
        self.antenna.taken.clear()
        self.proofs.on_time()
        return self.antenna.taken


@pytest.fixture
def node():
    node = Node()
    node.connect()
    return node


def test_a_new_gateway_is_told_the_nonce_and_asked_for_its_place_at_a_random_moment(node):
    assert node.sent(2.4) == []
    node.connect()
    assert node.proofs.next_s == 2.5
    assert node.sent(2.5) == [TO_GATEWAY, ASKS]


def test_heartbeats_are_frequent_until_the_second_answer_and_then_come_once_a_minute(node):
    node.sent(2.5)
    node.proofs.heard(ANSWER, 0)
    for _ in range(2):
        node.proofs.heard(packet("07 01 04 09 09 01 07"), 7)  # another gateway
    assert node.proofs.next_s == 10.0
    node.proved.add(0)
    node.places.update_gateway(Location(0.0, 0.0, 0.0), 0.0)
    assert node.sent(10.0) == [TO_GATEWAY]
    assert node.routes.tried[0] == 1  # only the first one was in vain
    node.proofs.heard(ANSWER, 0)
    assert node.proofs.next_s == 10.0 + 54.0


def test_on_a_busy_channel_heartbeats_without_an_answer_are_rarer(node):
    node.antenna.periods = 2.0
    at_s = 2.5
    for seconds in (7.5, 7.5, 52.5, 52.5):
        node.sent(at_s)
        assert node.proofs.next_s == at_s + seconds
        at_s += seconds


def test_without_a_way_up_nothing_is_sent_until_there_is_one(node):
    node.routes.neighbours.clear()
    node.routes.choose()
    assert node.sent(2.5) == []
    assert node.proofs.next_s == math.inf
    node.connect()
    assert node.proofs.next_s == 5.0


def test_a_parent_through_which_the_gateway_does_not_answer_gives_way_to_another(node):
    for number, at_s in enumerate((2.5, 10.0), 6):
        node.routes.clock.now_s = at_s
        node.hears(1, 2, number=number)
        assert node.routes.parent == 1
        assert node.sent(at_s) == [TO_GATEWAY, ASKS]
    node.hears(1, 2, number=8)
    assert node.routes.parent == 2
    node.proofs.heard(ANSWER, 0)
    assert (node.routes.in_vain_through(1), node.routes.in_vain_through(2)) == (1, 0)


def test_a_new_parent_is_tried_soon_if_the_gateway_never_answered_through_it(node):
    for at_s in (2.5, 10.0):
        node.sent(at_s)
        node.proofs.heard(ANSWER, 0)
    node.proofs.has_new_parent()  # the same one
    assert node.proofs.next_s == 64.0
    node.routes.neighbours.clear()
    node.hears(2, number=6)
    node.proofs.has_new_parent()
    assert node.proofs.next_s == 32.5  # 20 s after the last one, as in motion parents often change
    node.routes.clock.now_s = 29.0
    node.proofs.has_new_parent()
    assert node.proofs.next_s == 32.5


def test_a_gateway_that_moves_is_asked_once_in_ten_seconds_at_a_random_moment(node):
    node.proofs.due_s = math.inf
    node.proofs.ask_soon()
    node.routes.clock.now_s = 1.0
    node.proofs.ask_soon()
    assert node.sent(2.5) == [ASKS]
    node.routes.clock.now_s = 12.4
    node.proofs.ask_soon()
    assert node.proofs.next_s == math.inf
    node.routes.clock.now_s = 12.5
    node.proofs.ask_soon()
    assert node.proofs.next_s == 15.0


def test_a_question_that_waited_while_the_way_up_was_lost_asks_nobody(node):
    node.proofs.due_s = math.inf
    node.proofs.ask_soon()
    node.routes.neighbours.clear()
    node.routes.choose()
    assert node.sent(2.5) == []
    assert node.proofs.next_s == math.inf


def test_a_gateway_answers_routers_and_no_other_gateway_and_tells_nobody_by_itself():
    node = Node(is_gateway=True)
    node.connect()
    node.proofs.heard(FROM_ROUTER_5, 5)
    node.proofs.heard(ANSWER, 0)
    assert node.antenna.taken == [packet("09 09 04 01 05 01 09")]
    assert node.proofs.next_s == math.inf
    router = Node()
    router.proofs.heard(FROM_ROUTER_5, 5)
    assert router.antenna.taken == []


def test_without_a_key_a_heartbeat_is_of_another_technique_and_none_is_sent():
    node = Node(has_key=False)
    node.connect()
    node.proofs.heard(ANSWER, 0)
    assert node.complaints.counts == {"dropped a heartbeat of another technique": 1}
    assert node.proofs.next_s == math.inf
