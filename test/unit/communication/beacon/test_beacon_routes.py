"""BeaconRoutes: the parent and the ways to try."""

from __future__ import annotations

import sys
import threading

import pytest

from drone_mesh.communication.beacon.packets import (
    NO_ANCESTORS,
    NONE_BELOW,
    NOT_LISTED,
    Beacon,
    Below,
    Motion,
)
from drone_mesh.communication.beacon.routes import BeaconRoutes
from drone_mesh.communication.timing import Deadlines
from drone_mesh.drone.location import Location

STILL = (0.0, 0.0, 0.0)


@pytest.fixture
def routes():
    return BeaconRoutes(9, False, 10.0, lambda _node: None, one_loss_counts=True, clock=Deadlines())


@pytest.fixture
def shared_routes():
    return BeaconRoutes(
        9, False, 10.0, lambda _node: None, one_loss_counts=False, clock=Deadlines()
    )


def beacon(
    hops=1, parent=0, number=5, gateway=0, x=None, east=0.0, below=NONE_BELOW, others=(), near=()
):
    ancestors = (*others, *NO_ANCESTORS)[:3]
    motion = None if x is None else Motion(Location(0.0, x, 0.0), (0.0, east, 0.0))
    return Beacon(gateway, number, hops, parent, ancestors, 1.0, motion, below=below, near=near)


def ways(routes, node, came_from=255):
    return [way.neighbour for way in routes.next_hops(node, came_from)]


def test_the_parent_has_the_fewest_hops(routes):
    routes.heard(1, beacon(hops=3, parent=2))
    routes.heard(2, beacon(hops=1))
    assert routes.choose()
    assert (routes.parent, routes.hops, routes.gateway) == (2, 2, 0)


def test_the_present_parent_stays_while_no_other_is_nearer(routes):
    routes.heard(2, beacon())
    routes.choose()
    routes.heard(1, beacon())
    assert not routes.choose()
    assert routes.parent == 2


def test_there_is_no_way_to_the_next_hop_of_who_never_had_one(routes):
    """Whoever had heard a gateway and not chosen it yet asked node 255 for its place."""
    routes.heard(1, beacon())
    assert routes.get_direction_to_node(255) == 255
    assert routes.get_direction_to_node(1) == 1


def asked_in_vain(routes, neighbour, times):
    for _ in range(times):
        routes.asked(neighbour, in_vain=True)
    routes.choose()
    return routes.parent


def test_each_question_without_an_answer_costs_a_hop_for_ten_minutes(routes):
    routes.heard(1, beacon())
    routes.heard(2, beacon(hops=2, parent=8))
    routes.heard(3, beacon(hops=10, parent=8))
    assert asked_in_vain(routes, 1, times=1) == 1
    assert asked_in_vain(routes, 1, times=1) == 2
    routes.choose()
    routes.neighbours.pop(2)
    assert asked_in_vain(routes, 1, times=7) == 1  # eight hops at most
    routes.heard(2, beacon(hops=2, parent=8, number=6))
    routes.choose()
    assert routes.parent == 2
    routes.clock.now_s = 600.0
    for node in (1, 2):
        routes.heard(node, beacon(hops=node, parent=0 if node == 1 else 8, number=7))
    routes.choose()
    assert routes.parent == 1


def test_where_losses_are_usual_two_questions_without_an_answer_say_nothing(shared_routes):
    for node in (1, 2):
        shared_routes.heard(node, beacon())
    assert asked_in_vain(shared_routes, 1, times=2) == 1
    assert asked_in_vain(shared_routes, 1, times=1) == 2


def test_the_gateway_itself_swallows_nothing(routes):
    routes.heard(0, beacon(hops=0, parent=255))
    routes.heard(1, beacon())
    assert asked_in_vain(routes, 0, times=5) == 0


@pytest.mark.parametrize("generation", range(4))
def test_a_neighbour_that_stands_on_this_node_is_no_parent(routes, generation):
    line = [4, 5, 6, 0]
    line[generation] = 9
    routes.heard(1, beacon(hops=5, parent=line[0], others=line[1:]))
    assert not routes.choose()
    assert routes.parent == 255


def test_a_new_neighbour_two_numbers_back_is_a_route_and_one_three_back_is_none(routes):
    routes.heard(2, beacon(number=8, hops=4, parent=3))
    routes.heard(1, beacon(number=5, hops=2, parent=3))
    routes.choose()
    assert routes.parent == 2
    routes.heard(4, beacon(number=6, hops=2, parent=3))
    routes.choose()
    assert routes.parent == 4


def test_a_number_that_is_far_ahead_makes_no_other_neighbour_look_old(routes):
    for second in range(8):
        routes.clock.now_s = float(second)
        routes.heard(1, beacon(number=second, hops=0, parent=255))
        routes.heard(2, beacon(number=second + 10, hops=1))
        routes.choose()
        assert routes.parent == 1


def test_a_neighbour_whose_number_stays_the_same_for_five_intervals_leads_nowhere(routes):
    for second in range(8):
        routes.clock.now_s = float(second)
        routes.heard(1, beacon(number=3, hops=1))
        routes.heard(2, beacon(number=second, hops=4))
        routes.choose()
        assert routes.parent == (1 if second <= 5 else 2)


def test_a_gateway_without_a_new_number_for_five_intervals_is_lost(routes):
    routes.heard(1, beacon())
    routes.clock.now_s = 4.9
    routes.heard(1, beacon())
    routes.choose()
    assert routes.parent == 1
    routes.clock.now_s = 5.1
    routes.heard(1, beacon())
    routes.choose()
    assert routes.parent == 255


def test_on_a_shared_channel_a_neighbour_may_fail_once_until_it_is_heard_again(shared_routes):
    routes = shared_routes
    routes.heard(1, beacon())
    routes.heard(2, beacon(hops=2, parent=3))
    routes.choose()
    routes.clock.now_s = 0.5
    routes.failed(1)
    assert ways(routes, 0) == [1, 2]
    routes.heard(1, beacon())
    routes.clock.now_s = 0.6
    routes.failed(1)
    assert ways(routes, 0) == [1, 2]
    routes.clock.now_s = 0.7
    routes.failed(1)
    assert ways(routes, 0) == [2]


def test_on_a_shared_channel_a_neighbour_whose_beacon_is_late_may_not_fail(shared_routes):
    routes = shared_routes
    routes.heard(1, beacon())
    routes.heard(2, beacon(hops=2, parent=3))
    routes.choose()
    routes.clock.now_s = 1.3
    routes.failed(1)
    assert ways(routes, 0) == [2]


def test_a_failed_hop_is_replaced_at_once_and_back_when_it_is_heard_again(routes):
    routes.heard(1, beacon())
    routes.heard(2, beacon(hops=2, parent=3))
    routes.choose()
    routes.clock.now_s = 0.1
    routes.failed(1)
    assert routes.choose()
    assert routes.parent == 2
    routes.clock.now_s = 0.2
    routes.heard(1, beacon())
    routes.choose()
    assert routes.parent == 1


def test_a_neighbour_that_returned_a_packet_leads_to_its_addressee_no_longer(routes):
    routes.heard(1, beacon(hops=3, parent=8, below=Below(20, (20, 21))))
    routes.leads_not_to(20, 1)
    assert (ways(routes, 20), ways(routes, 21)) == ([], [1])


def test_a_link_that_will_break_costs_but_does_not_exclude(routes):
    routes.motion = Motion(Location(0.0, 0.0, 0.0), STILL)
    routes.heard(1, beacon(hops=1, x=9.0, east=2.0))
    routes.choose()
    assert routes.parent == 1
    routes.heard(2, beacon(hops=1, x=-5.0))
    routes.choose()
    assert routes.parent == 2


def test_a_neighbour_heard_from_out_of_reach_errs_and_is_judged_without_places(routes):
    routes.motion = Motion(Location(0.0, 0.0, 0.0), STILL)
    routes.heard(1, beacon(hops=1, x=50.0, east=2.0))
    assert routes.risk(routes.neighbours[1]) == 0.0


def test_a_neighbour_silent_for_two_and_a_half_intervals_is_forgotten(routes):
    routes.heard(1, beacon())
    routes.clock.now_s = 2.4
    assert routes.expired() == []
    routes.clock.now_s = 2.6
    assert routes.expired() == [1]


def test_on_a_shared_channel_a_neighbour_may_lose_two_beacons_and_be_late(shared_routes):
    shared_routes.heard(2, beacon())
    shared_routes.clock.now_s = 3.4
    assert shared_routes.expired() == []
    shared_routes.clock.now_s = 3.6
    assert shared_routes.expired() == [2]


def test_a_sign_of_life_is_as_good_as_a_beacon(routes):
    routes.heard(1, beacon())
    routes.clock.now_s = 2.0
    routes.alive(1)
    routes.clock.now_s = 4.0
    assert routes.expired() == []


def test_a_neighbour_that_lists_nobody_leads_to_nobody_unless_its_beacon_had_no_room(routes):
    routes.heard(1, beacon(hops=3, parent=8, below=Below(20, (20,))))
    routes.heard(1, beacon(hops=3, parent=8, below=NOT_LISTED))
    assert ways(routes, 20) == [1]
    routes.heard(1, beacon(hops=3, parent=8, below=NONE_BELOW))
    assert ways(routes, 20) == []


def test_a_packet_down_follows_the_child_that_announced_the_node_last(routes):
    """Also if the node has come back to an earlier one."""
    routes.heard(1, beacon(hops=3, parent=9, below=Below(20, (20,))))
    routes.clock.now_s = 0.5
    routes.heard(2, beacon(hops=3, parent=9, below=Below(20, (20,))))
    assert ways(routes, 20) == [2, 1]
    routes.clock.now_s = 1.0
    routes.heard(1, beacon(hops=3, parent=9, below=Below(20, (), (20,))))
    assert ways(routes, 20) == [1, 2]


def test_a_neighbour_that_hears_a_node_leads_to_it_until_that_is_two_intervals_old(routes):
    routes.heard(1, beacon(hops=3, parent=7, below=Below(50, (50,))))
    routes.heard(2, beacon(hops=4, parent=7, near=(50,)))
    assert ways(routes, 50) == [2, 1]
    routes.clock.now_s = 2.1
    routes.heard(2, beacon(hops=4, parent=7))
    assert ways(routes, 50) == [1]


def test_a_packet_for_an_unknown_node_goes_up_only_if_it_came_from_below(routes):
    routes.heard(1, beacon())
    routes.heard(2, beacon(hops=3, parent=9))
    routes.choose()
    assert ways(routes, 50) == [1]
    assert ways(routes, 50, came_from=2) == [1]
    assert ways(routes, 50, came_from=1) == []


def test_of_neighbours_that_stand_on_a_node_the_one_next_to_it_is_first(routes):
    routes.heard(1, beacon(hops=6, parent=7, others=(6, 50)))
    routes.heard(2, beacon(hops=5, parent=6, others=(50, 3)))
    routes.heard(3, beacon(hops=4, parent=50, others=(3, 4)))
    assert ways(routes, 50) == [3, 2, 1]


def test_a_child_that_stands_on_a_node_through_this_one_does_not_lead_to_it(routes):
    """Packets went down to it, round over its neighbours, and came back as copies."""
    routes.heard(26, beacon(hops=5, parent=50))
    routes.choose()
    routes.heard(8, beacon(hops=7, parent=9, others=(26, 50)))
    routes.heard(19, beacon(hops=8, parent=8, others=(9, 26)))
    assert ways(routes, 50) == [26]
    assert ways(routes, 26) == [26]


def test_a_node_is_looked_for_where_it_was_seen():
    seen = {50: (Location(0.0, 20.0, 0.0), 0.0)}

    class Heard:
        place, heard_s = seen[50]

    routes = BeaconRoutes(
        9, True, 10.0, lambda _node: Heard, one_loss_counts=True, clock=Deadlines()
    )
    routes.motion = Motion(Location(0.0, 0.0, 0.0), STILL)
    routes.heard(1, beacon(hops=1, x=5.0, parent=9))
    routes.heard(2, beacon(hops=1, x=-5.0, parent=9))
    assert ways(routes, 50) == [1]
    routes.clock.now_s = 11.0
    assert ways(routes, 50) == []


def test_a_way_over_a_link_that_loses_most_beacons_costs_more_than_a_hop(routes):
    routes.motion = Motion(Location(0.0, 0.0, 0.0), STILL)
    for interval in range(30):
        routes.clock.now_s = float(interval)
        routes.heard(2, beacon(hops=2, parent=3, number=interval, x=5.0))
        if interval % 4 == 0:
            routes.heard(1, beacon(hops=1, number=interval, x=9.0))
        routes.expired()
        routes.choose()
    assert routes.parent == 2


def test_one_lucky_beacon_from_beyond_the_range_makes_no_parent(routes):
    routes.motion = Motion(Location(0.0, 0.0, 0.0), STILL)
    routes.heard(2, beacon(hops=2, parent=3, x=5.0))
    routes.heard(1, beacon(hops=1, x=14.0))
    routes.choose()
    assert routes.parent == 2


def test_only_the_parent_and_the_gateway_say_that_the_gateway_has_no_internet(routes):
    routes.heard(1, beacon(hops=1, number=5))
    assert routes.choose()
    routes.heard(2, beacon(hops=1, number=105)._replace(offline=True))
    routes.choose()
    assert (routes.parent, routes.offline) == (1, False)

    routes.heard(1, beacon(hops=1, number=6)._replace(offline=True))
    assert routes.choose()
    assert routes.offline


def test_a_neighbour_that_has_not_heard_that_the_internet_failed_is_no_way_to_it(routes):
    routes.heard(1, beacon(hops=1, number=5))
    routes.heard(2, beacon(hops=1, number=5))
    routes.choose()
    routes.heard(routes.parent, beacon(hops=1, number=6)._replace(offline=True))
    routes.choose()
    assert routes.offline
    routes.heard(3 - routes.parent, beacon(hops=1, number=7))
    routes.choose()
    assert not routes.offline


def test_other_threads_may_ask_for_ways_while_beacons_come_in(routes):
    errors = []
    done = threading.Event()

    def ask():
        try:
            while not done.is_set():
                for node in range(40):
                    routes.get_direction_to_node(node)
                routes.get_table_size()
        except Exception as error:  # noqa: BLE001 - whatever it is
            errors.append(error)

    before = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    asking = threading.Thread(target=ask)
    asking.start()
    try:
        for step in range(4000):
            routes.clock.now_s = step / 10
            routes.heard(step % 37 + 1, beacon(hops=1 + step % 3, number=step % 256))
            routes.expired()
            routes.choose()
    finally:
        done.set()
        asking.join()
        sys.setswitchinterval(before)
    assert not errors


def located(routes, own_x, gateway_x=0.0):
    routes.motion = Motion(Location(0.0, own_x, 0.0), STILL)
    routes.gateway, routes.gateway_place = 0, Location(0.0, gateway_x, 0.0)
    return routes


def test_a_neighbour_has_as_many_hops_as_its_distance_from_the_gateway_needs(routes):
    """The range is 10 m; 25 m from the gateway nobody is one hop from it."""
    located(routes, 28.0)
    routes.heard(1, beacon(hops=2, parent=5, x=20.0))
    routes.choose()
    routes.heard(2, beacon(hops=1, x=25.0))
    assert not routes.choose()
    assert routes.parent == 1
    routes.heard(3, beacon(hops=1, x=20.0))  # claims two at most, which is no better
    assert not routes.choose()


@pytest.mark.parametrize("x", [None, 10.0], ids=["no place", "a place out of reach"])
def test_a_neighbour_that_tells_no_place_of_use_counts_as_if_it_were_here(routes, x):
    located(routes, 22.0)
    routes.heard(1, beacon(hops=2, parent=5, x=15.0))
    routes.choose()
    routes.heard(2, beacon(hops=1, x=x))
    assert not routes.choose()


def test_a_way_that_seems_too_short_is_taken_where_there_is_no_other(routes):
    located(routes, 28.0)
    routes.heard(2, beacon(hops=1, x=25.0))
    routes.choose()
    assert (routes.parent, routes.hops) == (2, 2)
