"""Beacons are rare while nothing changes; node 9 asks its parent whether it lives and hears it."""

from __future__ import annotations

import random

import pytest
from rig import AlwaysHalf

from drone_mesh.communication.beacon.packets import NO_ANCESTORS, Beacon
from drone_mesh.communication.beacon.routes import BeaconRoutes
from drone_mesh.communication.beacon.times import AT_REST_S, ParentWatch, Trickle
from drone_mesh.communication.timing import Deadlines, Medium

FAST = Medium.for_hop(0.0011)


@pytest.fixture
def trickle():
    made = Trickle(FAST, random.Random(1))
    made.start(0.0)
    return made


def test_the_interval_grows_to_a_bound_that_still_shows_a_dead_parent_in_time(trickle):
    for _ in range(10):
        trickle.sent(trickle.due_s)
    assert trickle.interval_s == AT_REST_S


def test_a_beacon_of_the_longest_interval_says_no_longer_one(trickle):
    for _ in range(10):
        trickle.sent(trickle.due_s)
    body = Beacon(0, 1, 1, 0, NO_ANCESTORS, trickle.interval_s).to_body(27)
    said = Beacon.from_body(body, None)
    assert said is not None
    assert said.interval_s <= trickle.longest_s


def test_an_interval_is_a_third_longer_than_the_one_before_it(trickle):
    intervals = []
    for _ in range(4):
        trickle.sent(trickle.due_s)
        intervals.append(trickle.interval_s)
    assert intervals == pytest.approx([0.5, 0.65, 0.845, 1.0985])


def test_beacons_come_up_to_a_fifth_of_the_interval_early_or_late(trickle):
    shares = []
    for turn in range(200):
        trickle.sent(10.0 * turn)
        shares.append((trickle.due_s - 10.0 * turn) / trickle.interval_s)
    assert 0.8 <= min(shares) < 0.82
    assert 1.18 < max(shares) <= 1.2


def test_a_change_makes_the_interval_short_again(trickle):
    for _ in range(10):
        trickle.sent(trickle.due_s)
    now_s = trickle.due_s - 1.0
    trickle.reset(now_s)
    assert trickle.interval_s == 0.5
    assert now_s <= trickle.due_s <= now_s + 0.5


def test_no_two_intervals_are_equal(trickle):
    times = []
    for _ in range(20):
        trickle.reset(trickle.due_s)
        trickle.sent(trickle.due_s)
        times.append(trickle.due_s)
    steps = [after - before for before, after in zip(times, times[1:])]
    assert len({round(step, 6) for step in steps}) == len(steps)
    assert all(0.4 <= step <= 0.6 for step in steps)


@pytest.mark.parametrize(("alone", "within_s"), [(True, 0.0132), (False, 0.0528)])
def test_who_is_asked_alone_answers_sooner(trickle, alone, within_s):
    waits = []
    for turn in range(1, 40):
        trickle.sent(10.0 * turn)
        trickle.answer(10.0 * turn + 0.3, alone=alone)
        waits.append(trickle.due_s - 10.0 * turn - 0.3)
    assert 0.8 * within_s < max(waits) <= within_s


def test_an_urgent_beacon_leaves_within_milliseconds_but_not_at_once_after_another(trickle):
    trickle.sent(10.0)
    trickle.hurry(10.3)
    assert 10.3 <= trickle.due_s <= 10.32
    trickle.sent(20.0)
    trickle.hurry(20.0)
    assert 20.1 <= trickle.due_s <= 20.12


def test_a_slow_radio_sends_beacons_less_often():
    assert Trickle(Medium.for_hop(0.1), random.Random(1)).interval_s == pytest.approx(40.0)


HOP_S = 0.01  # AlwaysHalf: node 9 waits for four hops more for each of its neighbours


class Node:
    def __init__(self, rng):
        self.routes = BeaconRoutes(
            9, False, 10.0, lambda _node: None, one_loss_counts=True, clock=Deadlines()
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
