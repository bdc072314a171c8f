"""Trickle: beacons are rare while nothing changes, and frequent when something does."""

from __future__ import annotations

import random

import pytest

from drone_mesh.communication.beacon.packets import NO_ANCESTORS, Beacon
from drone_mesh.communication.beacon.times import AT_REST_S, Trickle
from drone_mesh.communication.timing import Medium

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
