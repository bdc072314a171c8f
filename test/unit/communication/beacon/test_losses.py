"""Losses: what the beacons that a link loses cost."""

from __future__ import annotations

import pytest

from drone_mesh.communication.beacon.neighbour import MOST, Losses
from drone_mesh.drone.location import Location

HERE = Location(0.0, 0.0, 0.0)


@pytest.fixture
def losses():
    return Losses(range_m=10.0)


def hear(losses, times_s, apart_m=5.0):
    for now_s in times_s:
        cost = losses.heard(1, 1.0, HERE, Location(0.0, apart_m, 0.0), float(now_s))
    return cost


def test_a_link_that_loses_one_beacon_in_ten_costs_nothing(losses):
    assert hear(losses, [now_s for now_s in range(100) if now_s % 10]) == 0.0


@pytest.mark.parametrize(("every", "hops"), [(2, 1.0), (3, 2.0)])
def test_a_link_costs_the_frames_that_have_to_be_repeated(losses, every, hops):
    assert hear(losses, range(0, 120, every)) == pytest.approx(hops, abs=0.5)


def test_a_neighbour_that_was_silent_for_a_while_is_no_new_one(losses):
    assert hear(losses, range(0, 200, 10)) == MOST


def test_what_a_link_lost_is_forgotten_after_a_long_silence(losses):
    hear(losses, range(0, 200, 10))
    assert hear(losses, [220]) == 0.0


def test_what_a_link_lost_elsewhere_says_nothing(losses):
    hear(losses, range(0, 200, 10))
    assert losses.heard(1, 1.0, HERE, Location(0.0, 6.0, 0.0), 200.0) == 0.0


def test_one_place_beyond_the_range_may_be_wrong(losses):
    hear(losses, range(10))
    assert losses.heard(1, 1.0, HERE, Location(0.0, 12.0, 0.0), 10.0) == 0.0


@pytest.mark.parametrize(
    ("apart_m", "hops"), [(11.4, 0.0), (11.6, MOST), (22.9, MOST), (23.1, 0.0)]
)
def test_a_link_longer_than_the_range_has_to_prove_itself(losses, apart_m, hops):
    assert hear(losses, [0], apart_m) == hops
    assert hear(losses, range(1, 30), apart_m) == 0.0
