"""Verdicts: node 9 gives a packet to a neighbour, keeps it, returns it or drops it."""

from __future__ import annotations

import pytest
from rig import packet

from drone_mesh.communication.beacon.courier import DROP, HOLD, Transit
from drone_mesh.communication.beacon.packets import NO_ANCESTORS, Beacon, Below
from drone_mesh.communication.beacon.routes import BeaconRoutes
from drone_mesh.communication.beacon.verdicts import Searches, Verdicts
from drone_mesh.communication.timing import Deadlines, Due

OWN, FROM_5_THROUGH_1 = "09 09 00 00 32", "05 01 00 09 32"  # for node 50
UP = "05 01 00 09 00"


class Node:
    def __init__(self):
        self.deadlines, self.searches = Deadlines(), []
        self.routes = BeaconRoutes(
            9, False, 10.0, lambda _node: None, shared=False, clock=self.deadlines
        )
        searches = Searches(9, self.routes, lambda _k, _c, body: self.searches.append(body), 1e-5)
        self.verdicts = Verdicts(self.routes, searches, self.deadlines)

    def hear(self, neighbour, now_s=0.0, below=(), hops=3, parent=8):
        self.deadlines.now_s, listed = now_s, Below(0, below)
        self.routes.heard(neighbour, Beacon(0, 5, hops, parent, NO_ANCESTORS, 1.0, below=listed))

    def verdict(self, transit, now_s=0.0):
        self.deadlines.now_s = now_s
        return self.verdicts.verdict_on(transit)


@pytest.fixture
def node():
    return Node()


def transit(text):
    return Transit(packet(text), came_from=255 if text == OWN else 1, seen_s=0.0)


@pytest.mark.parametrize(
    ("text", "searches"),
    [(OWN, [b"\x32\1\0\x0c"]), (FROM_5_THROUGH_1, [b"\x32\1\0\2"]), (UP, [])],
)
def test_a_packet_without_a_way_waits_and_a_drone_is_searched_for(node, text, searches):
    node.routes.gateway = 0
    assert node.verdict(transit(text)) == HOLD
    assert node.searches == searches
    assert node.deadlines.get(Due.ROUTING) == 0.15
    node.deadlines.set(Due.ROUTING, 0.1)
    node.verdict(transit(text))
    assert node.deadlines.get(Due.ROUTING) == 0.1


def test_it_waits_for_two_and_a_half_seconds_and_a_bid_does_not(node):
    assert node.verdict(transit(OWN), 2.4) == HOLD
    assert node.verdict(transit(OWN), 2.5) == DROP
    assert node.verdict(transit("05 01 07 09 32")) == DROP


def test_a_relay_that_finds_nobody_returns_a_packet_once_and_to_a_neighbour_only(node):
    of_5 = transit(FROM_5_THROUGH_1)
    assert node.verdict(of_5, 0.6) == HOLD
    node.hear(1)
    assert node.verdict(of_5, 0.5) == HOLD
    assert node.verdict(of_5, 0.6) == 1
    of_5.failed_s[1] = 0.6
    assert node.verdict(of_5, 0.7) == HOLD
    of_5.sent_s, of_5.failed_s = {1: 0.6}, {}
    assert node.verdict(of_5, 0.7) == HOLD


def test_a_packet_does_not_go_back_to_where_it_came_from(node):
    node.hear(1, below=(50,))
    assert node.verdict(transit(FROM_5_THROUGH_1)) == HOLD


def test_a_neighbour_that_has_the_packet_gets_it_again_if_it_lists_the_addressee_again(node):
    own = transit(OWN)
    node.hear(2, below=(50,))
    own.sent_s[2] = 0.0
    assert node.verdict(own) == HOLD
    node.hear(2, 0.5, below=(50,))
    assert node.verdict(own, 0.5) == 2


def test_a_neighbour_that_did_not_take_the_packet_gets_it_again_after_a_sign_of_life(node):
    own = transit(OWN)
    node.hear(2, below=(50,))
    own.failed_s[2] = 0.1
    assert node.verdict(own, 0.1) == HOLD
    node.routes.clock.now_s = 0.2
    node.routes.alive(2)
    assert node.verdict(own, 0.2) == 2


@pytest.mark.parametrize(
    ("text", "sent_to", "to"), [(OWN, (3, 4), 5), (OWN, (3, 4, 5), HOLD), (UP, (3, 4, 5), 6)]
)
def test_three_neighbours_get_a_packet_down_and_any_number_one_up(node, text, sent_to, to):
    for age, neighbour in enumerate((3, 4, 5, 6)):
        node.hear(neighbour, 0.4 - 0.1 * age, below=(50,), hops=1 + age)
    node.routes.choose()
    sent = transit(text)
    sent.sent_s = dict.fromkeys(sent_to, 0.5)
    assert node.verdict(sent, 0.5) == to
