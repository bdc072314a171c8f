"""SeenMotion: who moves without an order of the mesh."""

from __future__ import annotations

import pytest

from drone_mesh.communication.neighbours.seen_motion import SeenMotion
from drone_mesh.drone.location import Location


@pytest.fixture
def motion():
    return SeenMotion(range_m=9.0, asked_s=10.0)


def report(motion, *places_m, every_s=10.0):
    """One node reports its places along a line."""
    for turn, metres in enumerate(places_m):
        motion.reported(1, Location(metres, 0.0, 0.0), turn * every_s)


def test_a_node_that_was_at_three_places_moves(motion):
    report(motion, 0.0, 3.0, 6.0)
    assert motion.moved_since(20.0)
    assert not motion.moved_since(20.1)


@pytest.mark.parametrize(
    "places_m",
    [(0.0, 0.5, 0.0, 0.8), (0.0, 8.0, 8.0, 8.2), (0.0, 8.0, 0.0, 8.0)],
    ids=["noise", "one flight", "there and back"],
)
def test_a_node_at_one_place_or_two_stands(motion, places_m):
    report(motion, *places_m)
    assert not motion.moved_since(0.0)


def test_a_slow_node_moves_too(motion):
    report(motion, *(0.3 * turn for turn in range(10)), every_s=1.0)
    assert motion.moved_since(0.0)


def test_steps_far_apart_in_time_are_separate_flights(motion):
    report(motion, 0.0, 3.0, 6.0, every_s=31.0)
    assert not motion.moved_since(0.0)


def test_a_repair_flight_is_no_motion(motion):
    motion.flies_for_repair(1, 5.0)
    report(motion, 0.0, 3.0, 6.0, every_s=5.0)
    assert not motion.moved_since(0.0)


def test_a_flight_for_the_mesh_starts_from_a_new_place(motion):
    report(motion, 0.0, 3.0)
    motion.forget(1)
    motion.reported(1, Location(6.0, 0.0, 0.0), 20.0)
    assert not motion.moved_since(0.0)
