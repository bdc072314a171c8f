"""What a node concludes from the silence of its neighbours."""

from __future__ import annotations

import pytest

from drone_mesh.communication.neighbours.neighbour_table import Neighbours
from drone_mesh.communication.neighbours.seen_motion import SeenMotion
from drone_mesh.drone.location import Location


@pytest.fixture
def neighbours() -> Neighbours:
    """Of a node that has lost its neighbour 3 at 100 s and still hears 2."""
    known = Neighbours(10.0, False, SeenMotion(1.0, 10.0))
    known.stands(0.0)
    for node in (2, 3):
        known.heard(node, 99.0)
    known.lost(3, 100.0)
    return known


def test_one_that_others_know_long_after_is_out_of_reach(neighbours):
    neighbours.note_known_elsewhere((7, 3), 161.0)
    assert neighbours.out_of_reach() == {3}


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
