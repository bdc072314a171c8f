"""FlightPath against the corners of a flight (docs/ros.md, "World and flights")."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drone_mesh.drone.flight_path import FlightPath

# 30 m, 40 m: a straight distance of 50 m takes 25 s and climbs 25 m
PATH = FlightPath(start=(0.0, 0.0, 0.05), goal=(30.0, 40.0, 0.05), start_s=100.0)

coordinates = st.floats(-5000, 5000)
places = st.tuples(coordinates, coordinates, st.floats(0, 500))


@pytest.mark.parametrize(
    ("share", "place"),
    [
        (0.0, (0.0, 0.0, 0.05)),
        (0.05, (0.0, 0.0, 12.55)),
        (0.10, (0.0, 0.0, 25.05)),
        (0.50, (15.0, 20.0, 25.05)),
        (0.90, (30.0, 40.0, 25.05)),
        (0.95, (30.0, 40.0, 12.55)),
        (1.0, (30.0, 40.0, 0.05)),
    ],
)
def test_a_flight_goes_up_across_and_down_at_its_shares_of_time(share, place):
    assert PATH.position_at(100.0 + share * 25.0) == pytest.approx(place)


def test_a_flight_takes_its_straight_distance_at_two_metres_a_second():
    assert PATH.duration_s == 25.0


def test_height_counts_in_the_straight_distance():
    path = FlightPath((0.0, 0.0, 0.0), (0.0, 3.0, 4.0), start_s=0.0)
    assert path.duration_s == 2.5
    assert path.waypoints == ((0.0, 0.0, 0.0), (0.0, 0.0, 2.5), (0.0, 3.0, 6.5), (0.0, 3.0, 4.0))


def test_before_its_start_the_drone_is_at_the_start_and_after_its_end_at_the_goal():
    assert PATH.position_at(0.0) == PATH.start
    assert PATH.position_at(1e6) == PATH.goal


def test_a_flight_of_no_distance_is_over_at_once():
    path = FlightPath((1.0, 2.0, 3.0), (1.0, 2.0, 3.0), start_s=5.0)
    assert path.position_at(5.0) == (1.0, 2.0, 3.0)


@pytest.mark.parametrize(("above_m", "at_s"), [(0.0, 5.0), (1.0, 4.8), (2.5, 4.5), (9.0, 4.5)])
def test_a_flight_is_so_high_above_its_goal_on_the_way_down_at_this_time(above_m, at_s):
    path = FlightPath((0.0, 0.0, 0.0), (10.0, 0.0, 0.0), 0.0, 2.0, ceiling_m=2.5)
    assert path.above_goal_s(above_m) == pytest.approx(at_s)


def test_descending_starts_at_nine_tenths_of_the_time():
    assert not PATH.is_descending(100.0 + 22.4)
    assert PATH.is_descending(100.0 + 22.5)


@given(places, places, st.floats(0, 1))
def test_a_drone_never_flies_lower_than_the_lower_end_and_never_jumps(start, goal, share):
    path = FlightPath(start, goal, start_s=0.0)
    here = path.position_at(share * path.duration_s)
    soon = path.position_at(share * path.duration_s + 0.01)
    assert here[2] >= min(start[2], goal[2]) - 1e-6
    # the fastest leg is at most half the distance and the height between, in a tenth of the time
    assert math.dist(here, soon) <= 0.01 * 2.0 / 0.1 + 1e-6


# Round something: 3 m along x, 4 m along y, 3 m back along x

ROUND = FlightPath((0.0, 0.0, 0.0), (0.0, 4.0, 0.0), 100.0, around=((3.0, 0.0), (3.0, 4.0)))


def test_a_way_round_takes_the_time_of_its_metres_over_ground():
    assert ROUND.ground_m == 10.0
    assert ROUND.duration_s == 5.0
    assert [ROUND.ground_flown_m(100.0 + 5.0 * share) for share in (0, 0.1, 0.5, 0.9, 1)] == (
        pytest.approx([0.0, 0.0, 5.0, 10.0, 10.0])
    )


@pytest.mark.parametrize(
    ("share", "place"),
    [
        (0.10, (0.0, 0.0, 2.0)),
        (0.34, (3.0, 0.0, 2.0)),
        (0.50, (3.0, 2.0, 2.0)),
        (0.66, (3.0, 4.0, 2.0)),
        (0.78, (1.5, 4.0, 2.0)),
        (0.90, (0.0, 4.0, 2.0)),
    ],
)
def test_a_way_round_leads_over_its_corners_at_one_height(share, place):
    assert ROUND.position_at(100.0 + share * 5.0) == pytest.approx(place)


def test_a_way_round_is_as_high_as_the_higher_of_its_ends():
    path = FlightPath((0.0, 0.0, 0.0), (0.0, 3.0, 4.0), 0.0, around=((3.0, 0.0),))
    assert [corner[2] for corner in path.waypoints] == [0.0, 6.5, 6.5, 6.5, 4.0]


@pytest.mark.parametrize(("share", "corners"), [(0.0, 5), (0.2, 4), (0.5, 3), (0.7, 2), (0.95, 1)])
def test_the_corners_that_are_passed_are_not_ahead(share, corners):
    assert ROUND.ahead(100.0 + share * 5.0) == list(ROUND.waypoints[-corners:])
