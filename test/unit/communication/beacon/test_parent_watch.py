"""ParentWatch: node 9 asks its parent, node 1, whether it lives and hears it."""

from __future__ import annotations

import random

import pytest
from rig import AlwaysHalf

from drone_mesh.communication.beacon.packets import NO_ANCESTORS, Beacon
from drone_mesh.communication.beacon.routes import BeaconRoutes
from drone_mesh.communication.beacon.times import ParentWatch
from drone_mesh.communication.timing import Deadlines

HOP_S = 0.01  # AlwaysHalf: node 9 waits for four hops more for each of its neighbours


class Node:
    def __init__(self, rng):
        self.routes = BeaconRoutes(
            9, False, 10.0, lambda _node: None, shared=False, clock=Deadlines()
        )
        self.watch = ParentWatch(self.routes, HOP_S, rng)

    def hear_parent(self, now_s=0.0, interval_s=1.0, near=(9,)):
        self.routes.clock.now_s = now_s
        self.routes.heard(1, Beacon(0, 5, 1, 0, NO_ANCESTORS, interval_s, near=near))
        self.routes.choose()
        return self.routes.neighbours[1]

    def asks(self, parent, *seconds):
        asked = []
        for self.routes.clock.now_s in seconds:
            asked += [self.routes.now_s] * self.watch.is_due(parent)
        return asked


@pytest.fixture
def node():
    node = Node(AlwaysHalf())
    node.routes.heard(2, Beacon(0, 5, 8, 1, NO_ANCESTORS, 1.0))
    node.hear_parent()  # the first beacon makes it the parent, and proves nothing yet
    return node


@pytest.mark.parametrize(
    ("interval_s", "asked_s"), [(0.5, 1.08), (1.0, 2.08), (1.5, 2.08), (3.0, 3.83)]
)
def test_a_parent_is_asked_when_its_beacon_is_late(node, interval_s, asked_s):
    parent = node.hear_parent(0.0, interval_s)
    assert node.watch.due_s(parent) == pytest.approx(asked_s)
    assert node.asks(parent, asked_s - 0.01, asked_s + 0.01) == [asked_s + 0.01]


def test_it_is_asked_again_after_an_interval_and_a_new_parent_at_once(node):
    parent = node.hear_parent()
    assert node.asks(parent, 2.1, 3.0, 3.2) == [2.1, 3.2]
    assert node.watch.due_s(parent) == pytest.approx(4.2, abs=0.01)
    node.watch.has_new_parent()
    assert node.asks(parent, 3.3) == [3.3]


def test_a_parent_that_sends_beacons_is_asked_if_it_names_this_node_in_none_for_five_seconds(node):
    node.hear_parent()
    for second in (1.0, 2.0, 3.0, 4.0):
        parent = node.hear_parent(second, near=())
    assert node.watch.due_s(parent) == 5.0
    assert node.asks(parent, 4.9, 5.0) == [5.0]


def test_a_parent_that_failed_is_not_asked(node):
    parent = node.hear_parent()
    node.routes.failed(1)
    assert node.asks(parent, 2.1) == []


def test_the_children_of_a_parent_ask_in_another_order_each_time():
    turns = []
    for seed in range(3):
        node = Node(random.Random(seed))
        parent = node.hear_parent()
        for _ in range(3):
            turns.append(node.watch.due_s(parent))
            node.watch.draw_turn()
    assert len({*turns}) == 9
