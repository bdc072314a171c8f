"""What a node concludes from the silence of its neighbours, and from how they move."""

from __future__ import annotations

import pytest

from drone_mesh.communication.neighbours import Neighbours, SeenMotion
from drone_mesh.communication.timing import UNDISTURBED
from drone_mesh.drone.location import Location


@pytest.fixture
def neighbours() -> Neighbours:
    """Of a node that has lost its neighbour 3 at 100 s and still hears 2."""
    known = Neighbours(UNDISTURBED, 10.0, 1.0)
    known.stands(0.0)
    for node in (2, 3):
        known.heard(node, 99.0)
    known.lost(3, 100.0)
    return known


def test_one_that_others_know_long_after_is_out_of_reach(neighbours):
    neighbours.note_known_elsewhere((7, 3), 161.0)
    assert neighbours.out_of_reach() == {3}


def test_a_node_that_hears_none_takes_all_that_fell_silent_for_out_of_reach(neighbours):
    assert neighbours.out_of_reach() == set()
    neighbours.lost(2, 150.0)
    assert neighbours.out_of_reach() == {2, 3}


def test_one_that_others_still_name_at_first_may_be_dead(neighbours):
    neighbours.note_known_elsewhere((3,), 159.0)
    assert neighbours.out_of_reach() == set()


def test_it_is_no_longer_out_of_reach_once_it_is_heard(neighbours):
    neighbours.note_known_elsewhere((3,), 161.0)
    neighbours.heard(3, 162.0)
    assert neighbours.out_of_reach() == set()


@pytest.mark.parametrize("leaves", [Neighbours.forget_all, lambda known: known.takes_off(True)])
def test_after_a_flight_all_links_are_new(neighbours, leaves):
    neighbours.note_known_elsewhere((3,), 161.0)
    leaves(neighbours)
    neighbours.note_known_elsewhere((3,), 200.0)
    assert neighbours.out_of_reach() == set()


GOAL, ON_THE_WAY = Location(8.0, 0.0, 0.0), Location(4.0, 0.0, 4.0)


def test_the_goal_of_a_drone_in_flight_counts_although_it_is_seen_on_the_way(neighbours):
    """Beacons tell where it is just now; another drone must not land at its goal meanwhile."""
    neighbours.set_place(2, GOAL, 101.0, is_goal=True)
    neighbours.passes(2, ON_THE_WAY, 102.0)
    assert neighbours.place_of(2).place == GOAL


def test_where_it_was_seen_on_the_way_counts_beside_its_goal(neighbours):
    """It may have stopped there, and fallen silent."""
    neighbours.set_place(2, GOAL, 101.0, is_goal=True)
    neighbours.passes(2, ON_THE_WAY, 102.0)
    assert [heard.place for _node, heard in neighbours.taken()] == [GOAL, ON_THE_WAY]
    neighbours.set_place(2, GOAL, 103.0)
    assert [heard.place for _node, heard in neighbours.taken()] == [GOAL]


def test_where_it_is_seen_counts_once_it_tells_no_goal_any_more(neighbours):
    neighbours.set_place(2, GOAL, 101.0, is_goal=True)
    neighbours.passes(2, ON_THE_WAY, 112.0)
    assert neighbours.place_of(2).place == ON_THE_WAY


def test_what_it_says_itself_at_rest_counts_at_once(neighbours):
    neighbours.set_place(2, GOAL, 101.0, is_goal=True)
    neighbours.set_place(2, ON_THE_WAY, 102.0)
    neighbours.passes(2, GOAL, 102.5)
    assert neighbours.place_of(2).place == GOAL


def test_what_others_heard_before_it_was_seen_counts_beside_that_as_it_may_be_its_goal(neighbours):
    """They tell the place of a silent drone, and not whether that was where it flew to."""
    neighbours.passes(2, ON_THE_WAY, 101.7)
    neighbours.passes(2, GOAL, 100.9)
    assert [heard.place for _node, heard in neighbours.taken()] == [ON_THE_WAY, GOAL]
    neighbours.passes(2, ON_THE_WAY, 103.0)
    assert [heard.place for _node, heard in neighbours.taken()] == [ON_THE_WAY]


def test_what_others_heard_long_before_it_was_seen_elsewhere_does_not_count(neighbours):
    neighbours.passes(2, ON_THE_WAY, 111.0)
    neighbours.passes(2, GOAL, 100.9)
    assert [heard.place for _node, heard in neighbours.taken()] == [ON_THE_WAY]


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
