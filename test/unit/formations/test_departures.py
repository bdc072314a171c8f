"""The drones of a formation set out so that none meets another, and the mesh holds."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from drone_mesh.drone.fleet import plan_fleet
from drone_mesh.drone.flight_path import FlightPath
from drone_mesh.drone.location import Location
from drone_mesh.drone.roles import Role
from drone_mesh.formations.airspace import nearest_m, segments, ways_of
from drone_mesh.formations.departures import Departures, FlightRules
from drone_mesh.formations.layouts import Layouts
from drone_mesh.formations.preview import lost_routes, preview
from drone_mesh.state.model import MeshStatus, NodeStatus

LAYOUTS = Layouts.shipped()


def at(x, y, z=0.0):
    return Location(latitude=y, longitude=x, height=z)


def mesh(places, hops=None, routes=None, **more):
    nodes = [NodeStatus(0, role=Role.GATEWAY, connected=True, position=(0.0, 0.0, 0.0))]
    for drone, place in places.items():
        node = NodeStatus(drone, connected=True, position=place.to_vector())
        node.hops = (hops or {}).get(drone, 1)
        node.route = bytes((routes or {}).get(drone, ()))
        nodes.append(node)
    return MeshStatus(0.0, nodes, **more)


def choose(state, goals, sent=None, rules=FlightRules()):  # noqa: B008
    return Departures(state, goals, sent or {}, rules).choose(goals)


def fleet(routers, spacing=1.0):
    places = plan_fleet(1, routers, 6, spacing)
    return MeshStatus(
        0.0,
        [
            NodeStatus(p.node_id, p.role, connected=True, position=(p.longitude, p.latitude, 0.0))
            for p in places
        ],
    )


def test_the_distance_of_segments_is_that_of_their_nearest_points():
    level = segments([(0, 0, 1), (10, 0, 1)])
    crossing, beside, point = [(5, -5, 3), (5, 5, 3)], [(2, 4, 1), (8, 4, 1)], [(20, 5, 1)]
    others = np.concatenate([segments(corners) for corners in (crossing, beside, point)])
    assert nearest_m(level, others) == pytest.approx([2.0, 4.0, math.hypot(10, 5)])


def test_paths_that_cross_at_one_height_are_not_flown_together():
    places = {1: at(3, 0), 2: at(0, 3)}
    goals = {1: at(-3, 0), 2: at(0, -3)}
    (first,) = choose(mesh(places, hops={1: 1, 2: 2}), goals).set_out
    assert first == 2
    assert choose(mesh(places), goals, sent={2: goals[2]}).set_out == {}


def test_a_goal_is_free_only_when_the_drone_that_stands_there_has_left():
    places = {1: at(3, 0), 2: at(6, 0), 3: at(6, 6)}
    goals = {1: at(6, 0), 2: at(-6, 0)}
    assert 1 not in choose(mesh(places), goals).set_out
    choice = choose(mesh(places), {1: at(6, 6)})
    assert choice.set_out == {}
    assert choice.blocked == {1: "drone 3 is in the way"}


def test_two_formations_with_one_place_do_not_stack_their_drones():
    places = {1: at(3, 0), 2: at(-3, 0), **{n: at(0, 0.9 * n) for n in range(3, 14)}}
    goals = {1: at(5, 5), 2: at(5, 5)}
    assert list(choose(mesh(places), goals).set_out) == [2]
    there = mesh({**places, 2: at(5, 5)})
    assert choose(there, goals).blocked == {1: "drone 2 is in the way"}


@pytest.mark.parametrize("clearance_m", [0.5, 1.0, 3.0])
def test_two_formations_keep_the_clearance_between_their_drones(clearance_m):
    rules = FlightRules(clearance_m=clearance_m)
    for away_m, blocked in ((0.9 * clearance_m, True), (clearance_m, False)):
        places = {1: at(5, 5), 2: at(-3, 0), 3: at(0, 3), 4: at(0, 6), 5: at(0, 9)}
        goals = {1: at(5, 5), 2: at(5, 5 - away_m)}
        assert bool(Departures(mesh(places), goals, {}, rules).taken_by(2)) is blocked
        assert (2 not in choose(mesh(places), goals, rules=rules).set_out) is blocked
        flying = mesh({**places, 1: at(9, 5)})
        flying.nodes[1].path = (9.0, 5.0, 0.0, 5.0, 5.0, 0.0)
        if blocked:
            assert 2 not in choose(flying, goals, rules=rules).set_out


def test_drones_that_change_places_let_each_other_pass():
    places = {1: at(3, 0), 2: at(6, 0)}
    found = preview(mesh(places), {1: places[2], 2: places[1]})
    assert found.stays == {}
    assert found.out_of_reach == []


def test_far_drones_set_out_before_relays():
    places = {n: at(6.0 * n, 0) for n in (1, 2, 3)}
    routes = {1: (1, 0), 2: (2, 1, 0), 3: (3, 2, 1, 0)}
    state = mesh(places, {1: 1, 2: 2, 3: 3}, routes)
    goals = {n: at(0, 6.0 * n) for n in (1, 2, 3)}
    assert list(choose(state, goals).set_out) == [3]


def test_a_far_drone_does_not_wait_for_a_relay_that_cannot_go():
    places = {**{n: at(0.9 * n - 7, 2.0) for n in range(5, 16)}, 9: at(-8, 2)}
    state = mesh({**places, **{n: at(-16, n) for n in range(1, 5)}})
    (flying,) = [node for node in state.nodes if node.id == 7]
    flying.path = (*flying.position, -8.0, 8.0, 0.0)
    assert list(choose(state, {8: at(40, 40), 9: at(6, 0)}).set_out) == [8]


def test_a_relay_that_only_routes_need_leaves_when_all_are_connected_though_others_fly():
    places = {n: at(0.9 * n - 7, 2.0) for n in range(1, 16)}
    state = mesh(places, routes={n: (n, 9, 0) for n in range(1, 5)})
    state.nodes[7].path = (*places[7].to_vector(), -8.0, 8.0, 0.0)
    assert list(choose(state, {9: at(6, 0)}).set_out) == [9]
    for lost in state.nodes[1:5]:
        lost.connected = False
    assert choose(state, {9: at(6, 0)}).set_out == {}


def test_drones_of_the_latest_formation_set_out_first_and_others_leave_them_room():
    places = {n: at(0.9 * n - 5, 2.0) for n in range(1, 11)}
    goals = {1: at(-6, 6), 2: at(6, 6)}
    state = mesh(places, routes={3: (3, 2, 0)})
    assert list(Departures(state, goals, {}, first={2}).choose(goals).set_out) == [2]
    state.nodes[9].path = (*places[9].to_vector(), 8.0, -8.0, 0.0)
    state.nodes[3].connected = False
    assert Departures(state, goals, {}, first={2}).choose(goals).set_out == {}
    assert list(Departures(state, goals, {}).choose(goals).set_out) == [1]


def test_who_stands_in_the_way_of_the_latest_formation_sets_out_before_the_others():
    places = {**{n: at(0.9 * n - 5, 2.0) for n in range(1, 11)}, 1: at(6, 6)}
    goals = {1: at(8, 0), 2: at(-6, 6), 3: at(6, 6)}
    state = mesh(places)
    state.nodes[9].path = (*places[9].to_vector(), 8.0, -8.0, 0.0)
    assert list(Departures(state, goals, {}, first={3}).choose(goals).set_out) == [1]


def test_a_far_drone_does_not_wait_for_one_whose_place_a_waiting_relay_holds():
    places = {**{n: at(0.9 * n - 9, -2.0) for n in range(1, 17)}, 17: at(6, 3), 18: at(14, 3)}
    goals = {16: at(6, 3), 17: at(30, 30), 18: at(40, 40), 15: at(-40, 0)}
    flying = mesh(places)
    flying.nodes[14].path = (*places[14].to_vector(), 3.0, -8.0, 0.0)
    assert 16 not in choose(flying, goals).set_out
    assert 18 in choose(flying, goals).set_out


def test_a_preview_flies_the_drones_of_standing_formations_too():
    places = {1: at(1, 0), 2: at(4, 0)}
    there = {1: at(4, 0)}
    assert preview(mesh(places), there).stays == {1: "drone 2 is in the way"}
    found = preview(mesh(places), there, standing={2: at(-4, 0)})
    assert found.stays == {}
    assert found.duration_s > preview(mesh({1: at(1, 0)}), there).duration_s


def test_a_preview_ends_when_the_last_of_those_that_land_together_has_landed():
    places = {1: at(0, 3), 2: at(3, 0)}
    found = preview(mesh(places), {1: at(0, 6.4), 2: at(5.2, 0)}, at_once=True)
    assert found.duration_s == pytest.approx(1.7)


def test_at_most_a_fifth_of_the_drones_is_away_at_once():
    places = {n: at(1.5 * (n % 5) - 3, 1.5 * (n // 5) + 1.5) for n in range(1, 21)}
    goals = {n: place._replace(longitude=place.longitude + 8) for n, place in places.items()}
    assert len(choose(mesh(places), goals).set_out) == 4
    assert len(choose(mesh(places, routing="beacon"), goals).set_out) > 4


def test_a_preview_names_who_will_be_out_of_reach():
    places = {1: at(1, 0), 2: at(2, 0), 3: at(3, 0)}
    found = preview(mesh(places), {2: at(30, 0), 3: at(0, 30)})
    assert found.out_of_reach == [2, 3]
    assert found.in_words().startswith("2 drones would be out of reach: 2..3; ")


def test_a_preview_names_the_drones_whose_places_are_taken():
    places = {1: at(1, 0), 2: at(4, 0)}
    assert preview(mesh(places), {1: at(4.5, 0)}).stays == {1: "drone 2 is in the way"}


@pytest.mark.parametrize(("before", "case"), [*itertools.permutations((0, 100, 101, 202), 2)])
def test_between_layouts_the_mesh_of_17_holds(before, case):
    state = fleet(17)
    for drone, goal in LAYOUTS.orders(before):
        if drone <= 17:
            state.nodes[drone].position = goal.to_vector()
    found = preview(state, dict(LAYOUTS.orders(case)))
    assert found.stays == {}
    assert found.least_connected >= 0.75  # one cut on the way from 100 to 0


@pytest.mark.slow
def test_254_drones_keep_80_percent_of_the_mesh_on_their_way_to_the_grid():
    state = fleet(253, spacing=1.1)  # so that nobody stands at a place of the grid
    goals = dict(LAYOUTS.orders(100))
    assert preview(state, goals, at_once=True).least_connected < 0.3
    found = preview(state, goals)
    assert found.least_connected >= 0.8


def test_dynamic_drones_keep_the_room_that_they_sway():
    paths = [FlightPath((0, y, 0), (10, y, 0), 0.0) for y in (0.0, 1.2)]
    assert nearest_m(ways_of(paths[0]), ways_of(paths[1])).min() == pytest.approx(1.2)
    places = {1: at(3, 3), 2: at(-3, 4.2)}
    goals = {1: at(-3, 3), 2: at(3, 4.2)}
    assert len(choose(mesh(places), goals).set_out) == 1  # 20 % of two: one at a time
    wide = Departures(mesh(places), goals, {1: goals[1]}, FlightRules(sway_m=0.5))
    assert wide.choose([2]).set_out == {}


def test_a_flight_out_of_reach_is_named_before_it_is_flown():
    state = mesh({1: at(5, 0), 2: at(10, 0)})
    assert not lost_routes(state, {2: at(13, 0)})
    assert lost_routes(state, {2: at(77, 0)}).in_words() == "drone 2 would have no route there"


def test_a_relay_that_leaves_is_held_against_its_flight_and_not_against_others():
    state = mesh({1: at(5, 0), 2: at(10, 0), 3: at(15, 0), 4: at(0, 40)})
    lost = lost_routes(state, {1: at(-5, 0)})
    assert lost.in_words() == "drones 2..3 would lose their routes"
    assert lost_routes(state, {3: at(15, 1)}).in_words() == ""


def test_routes_are_those_of_when_present_flights_have_ended():
    state = mesh({1: at(30, 0), 2: at(5, 1)})
    state.nodes[1].path = (30.0, 0.0, 0.0, 5.0, 0.0, 0.0)
    assert not lost_routes(state, {2: at(10, 0)})


def test_nobody_is_said_to_lose_a_route_if_the_range_is_not_known():
    assert not lost_routes(mesh({1: at(5, 0)}, max_distance=0.0), {1: at(77, 0)})
