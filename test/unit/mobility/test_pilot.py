"""A pilot: on the track, on the way to it, and during a pause."""

from __future__ import annotations

import math

import pytest

from drone_mesh.mobility.pilot import TrackPilot, along

SQUARE = [(0.0, 0.0, 3.0), (4.0, 0.0, 3.0), (4.0, 4.0, 3.0), (0.0, 4.0, 3.0)]


def fly(pilot, place, from_s, to_s, step_s=0.1):
    """All places at these times, the last one being at `to_s`."""
    places = [place]
    for tick in range(round(from_s / step_s), round(to_s / step_s) + 1):
        places.append(pilot.move(places[-1], tick * step_s))
    return places


def test_the_drone_climbs_flies_to_the_first_waypoint_and_then_the_track():
    pilot = TrackPilot(along(SQUARE, 1.0, loop=True), 1.0)
    places = fly(pilot, (-2.0, 0.0, 0.0), 0.0, 30.0)
    assert {p[:2] for p in places if p[2] < 2.99} == {(-2.0, 0.0)}
    assert all(math.dist(a, b) <= 0.1 + 1e-9 for a, b in zip(places, places[1:]))
    for corner in SQUARE:
        assert min(math.dist(place, corner) for place in places) < 0.11


def test_a_mission_without_a_loop_ends_at_its_last_waypoint():
    pilot = TrackPilot(along(SQUARE, 1.0, loop=False), 1.0)
    places = fly(pilot, SQUARE[0], 0.0, 60.0)
    assert places[-1] == SQUARE[-1]
    assert pilot.heading is None


def test_one_waypoint_is_a_flight_to_it():
    pilot = TrackPilot(along(SQUARE[:1], 1.0, loop=True), 1.0)
    assert fly(pilot, (3.0, 0.0, 0.0), 0.0, 10.0)[-1] == SQUARE[0]


def test_the_heading_is_the_next_waypoint():
    pilot = TrackPilot(along(SQUARE, 1.0, loop=True), 1.0)
    assert pilot.heading == SQUARE[0]
    place = fly(pilot, SQUARE[0], 0.0, 1.0)[-1]
    assert pilot.heading == pytest.approx(SQUARE[1])
    assert place == pytest.approx((0.9, 0.0, 3.0), abs=0.11)


def test_a_pause_takes_no_time_of_the_track_and_an_order_may_move_the_drone_meanwhile():
    pilot = TrackPilot(along(SQUARE, 1.0, loop=True), 1.0)
    place = fly(pilot, SQUARE[0], 0.0, 2.0)[-1]
    pilot.pause()
    assert pilot.paused
    assert pilot.heading is None
    pilot.resume()
    ordered = (place[0], place[1] - 3.0, 0.0)
    places = fly(pilot, ordered, 50.0, 90.0)
    back = next(i for i, p in enumerate(places) if math.dist(p, place) < 1e-6)
    assert all(math.dist(a, b) <= 0.1 + 1e-9 for a, b in zip(places, places[1:]))
    assert back * 0.1 == pytest.approx(6.0, abs=0.3)  # 3 m up, 3 m across
    assert places[back + 5] == pytest.approx((place[0] + 0.5, 0.0, 3.0), abs=0.11)
