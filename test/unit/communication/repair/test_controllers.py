"""`virtual_spring` and `fiedler`: their rules by hand and against numpy, and their limits."""

from __future__ import annotations

import math
import random
from types import SimpleNamespace

import numpy as np
import pytest

from drone_mesh.air.graph import Graph, within
from drone_mesh.communication.control.router_states import RepairState
from drone_mesh.communication.repair.algebraic_connectivity import (
    AT_REACH,
    fiedler,
    gradient,
    weights,
    widest_gap_m,
)
from drone_mesh.communication.repair.fiedler import BOUND, MOST_PLACES, Fiedler
from drone_mesh.communication.repair.interfaces import NeighbourView
from drone_mesh.communication.repair.virtual_spring import REST, VirtualSpring, force_m
from drone_mesh.drone.location import Location

RANGE_M = 9.0
REST_M = REST * RANGE_M


def at(x, y):
    return Location.from_vector((x, y, 0.0))


def stub(here, gateway, views, legs):
    """What a router tells a strategy that wants to fly a leg; `legs` are where it sends it."""
    return SimpleNamespace(
        now_s=100.0, node_id=1, connected=False, state=RepairState.LOST, bids_within_s=10.0,
        medium=SimpleNamespace(stretched=lambda seconds: seconds), range_m=RANGE_M,
        clearance_m=1.0, gateway_place=gateway, own_place=lambda: here, why_not_fly=lambda: "",
        neighbours=lambda: views, reachable=lambda: views,
        ask_places=lambda: None, wait_until=lambda at_s: None,
        fly=lambda step, until_connected: legs.append(step.place),
    )  # fmt: skip


def decides(strategy, here, gateway, *others):
    """(where its first leg ends, or None; why it stays) of a drone that knows these places."""
    views = {node: NeighbourView(place, 1.0, 255) for node, place in enumerate(others, start=2)}
    legs = []
    strategy.start(stub(here, gateway, views, legs))
    strategy.on_time()
    if not legs and not strategy.reason:
        strategy.on_time()  # it lets another one on its way fly first
    return (legs[0] if legs else None), strategy.reason


# Virtual springs -------------------------------------------------------------------------------


def test_a_spring_pushes_under_its_length_and_pulls_over_it_and_the_centre_pulls():
    """Drawn by hand: 3 m east is 3 m too near, 9 m north 3 m too far; the centre is 4 m south."""
    north, east, up = force_m(at(0, 0), [at(3, 0), at(0, 9)], at(0, -4), rest_m=6.0)
    assert (east, north, up) == pytest.approx((-1.5, 1.5 - 4.0, 0.0))
    assert force_m(at(0, 0), [at(0, 0)], at(0, 0), rest_m=6.0) == (0.0, 0.0, 0.0)


def test_drones_around_a_centre_come_to_rest_apart_and_no_single_one_can_cut_the_others():
    """The aim of Liu et al.: bi-connectivity, from wherever they come."""
    rng = random.Random(1)
    places = {
        0: at(0, 0),
        **{n: at(rng.uniform(-30, 30), rng.uniform(-30, 30)) for n in range(1, 9)},
    }
    for _step in range(400):
        near = within(places, RANGE_M)
        forces = {
            n: force_m(p, [places[o] for o in near[n]], at(0, 0), REST_M) for n, p in places.items()
        }
        before, places = places, {
            n: Location(*(a + 0.2 * f for a, f in zip(p, forces[n]))) if n else p
            for n, p in places.items()
        }  # fmt: skip
    assert max(before[n].distance_m(places[n]) for n in places) < 0.01
    graph = Graph(within(places, RANGE_M))
    assert graph.is_connected()
    assert graph.cut_vertices([0]) == []
    assert min(a.distance_m(b) for n, a in places.items() for m, b in places.items() if n > m) > 1.0


def test_a_weak_force_is_no_flight_and_a_strong_one_at_most_half_the_range():
    goal, why = decides(VirtualSpring(), at(2, 0), at(0, 0))
    assert (goal, why) == (None, "its pushes and pulls balance")
    goal, _why = decides(VirtualSpring(), at(200, 0), at(0, 0), at(206, 0))
    assert 4.0 < goal.distance_m(at(200, 0)) < RANGE_M / 2
    assert goal.longitude < 200


# The second eigenvalue -------------------------------------------------------------------------


def second_of(places, reach_m):
    """By numpy."""
    links = np.array(weights(places, reach_m))
    return np.linalg.eigvalsh(np.diag(links.sum(axis=1)) - links)[1]


@pytest.mark.parametrize("size", [2, 3, 8, 25])
def test_eigenvalue_and_gradient_are_those_of_numpy_and_of_finite_differences(size):
    rng = np.random.default_rng(size)
    places = rng.uniform(0.0, 5.0 * math.sqrt(size), (size, 3))
    reach_m = max(RANGE_M, widest_gap_m(places.tolist()))
    value, vector = fiedler(places.tolist(), reach_m)
    assert value == pytest.approx(second_of(places, reach_m), rel=1e-6)
    for node in range(min(size, 4)):
        differences = []
        for axis in range(3):
            step = np.zeros_like(places)
            step[node, axis] = 1e-5
            ends = second_of(places + step, reach_m), second_of(places - step, reach_m)
            differences.append((ends[0] - ends[1]) / 2e-5)
        found = gradient(node, places.tolist(), reach_m, vector)
        assert found == pytest.approx(differences, rel=1e-3, abs=1e-8)


def test_the_values_of_small_graphs_are_those_of_the_textbook():
    pair = [at(0, 0), at(RANGE_M, 0)]
    assert fiedler(pair, RANGE_M)[0] == pytest.approx(2 * AT_REACH)
    line = [at(0, 0), at(REST_M, 0), at(2 * REST_M, 0)]
    assert fiedler(line, RANGE_M)[0] == pytest.approx(AT_REACH ** (4 / 9), rel=0.02)
    assert fiedler(line, RANGE_M)[0] > BOUND
    assert widest_gap_m([at(0, 0), at(30, 0), at(4, 0), at(17, 0)]) == pytest.approx(13.0)


# The dumbbell: two triangles, whose bridge at (7.5, 2.5) was lost; the gateway is one of the left.
LEFT = [at(0, 0), at(0, 5), at(-4, 2.5)]
RIGHT = [at(15, 0), at(15, 5), at(19, 2.5)]


def test_over_the_gap_of_a_dumbbell_each_part_is_pulled_to_the_other():
    places = LEFT + RIGHT
    value, vector = fiedler(places, widest_gap_m(places))
    assert {math.copysign(1, entry) for entry in vector[:3]} != {math.copysign(1, vector[3])}
    for node, place in enumerate(places):
        _north, east, _up = gradient(node, places, widest_gap_m(places), vector)
        assert (east > 0) is (node < 3), place
    moved = [*LEFT, at(12, 0), at(12, 5), RIGHT[2]]
    assert fiedler(moved, widest_gap_m(places))[0] > value


def test_a_drone_of_the_dumbbell_flies_half_the_range_towards_the_gateway():
    everybody = dict(enumerate(LEFT + RIGHT, start=10))
    ideal = Fiedler(lambda: {**everybody, 1: RIGHT[0]})
    for strategy in (Fiedler(), ideal):
        goal, _why = decides(strategy, RIGHT[0], LEFT[0], RIGHT[1], RIGHT[2])
        assert goal.distance_m(RIGHT[0]) == pytest.approx(RANGE_M / 2)
        assert goal.longitude < RIGHT[0].longitude - 3.0


def test_where_what_it_knows_is_well_connected_a_drone_stays():
    goal, why = decides(Fiedler(), at(5, 0), at(0, 0), at(2, 4))
    assert (goal, why) == (None, "no leg connects the mesh that it knows better")
    alone = Fiedler(dict)
    assert decides(alone, at(5, 0), at(0, 0)) == (None, "knows no place but its own")


@pytest.mark.parametrize("strategy", [VirtualSpring, Fiedler])
def test_a_neighbour_that_claims_to_be_far_away_does_not_pull(strategy):
    honest, _why = decides(strategy(), at(20, 0), at(0, 0), at(24, 0))
    lied_to, _why = decides(strategy(), at(20, 0), at(0, 0), at(24, 0), at(1e30, 0))
    assert lied_to == honest


@pytest.mark.parametrize("strategy", [VirtualSpring, Fiedler])
def test_a_drone_that_flies_to_and_fro_stops_after_three_times_the_legs_of_the_way(strategy):
    tried = strategy()
    legs = 0
    while decides(tried, at(18, 0), at(0, 0))[0] is not None:  # it never gets anywhere
        legs += 1
    assert (legs, tried.reason) == (15, "flew to and fro without success")
    tried.on_gateway_found()
    assert decides(tried, at(18, 0), at(0, 0))[0] is not None


@pytest.mark.parametrize("strategy", [VirtualSpring, Fiedler])
def test_a_drone_lets_another_one_on_its_way_fly_first_and_then_passes_it(strategy):
    behind = strategy()
    legs = []
    views = {2: NeighbourView(at(17, 0.5), 1.0, 255)}
    behind.start(stub(at(20, 0), at(0, 0), views, legs))
    behind.on_time()
    assert legs == []
    behind.on_time()
    assert len(legs) == 1


def test_of_many_claimed_neighbours_only_the_nearest_count():
    rng = random.Random(1)
    here, gateway = at(0.0, 0.0), at(-20.0, 0.0)
    claimed = [at(rng.uniform(-9, 9), rng.uniform(-9, 9)) for _ in range(250)]
    nearest = sorted(claimed, key=here.distance_m)[:MOST_PLACES]
    assert decides(Fiedler(), here, gateway, *claimed) == decides(
        Fiedler(), here, gateway, *nearest
    )
