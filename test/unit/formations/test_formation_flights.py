"""No two drones of a formation come near each other, however late each order takes effect."""

from __future__ import annotations

import random

import numpy as np
import pytest

from drone_mesh.drone.fleet import plan_fleet
from drone_mesh.drone.flight_path import SPEED_M_S, FlightPath
from drone_mesh.drone.location import Location
from drone_mesh.formations.departures import AT_PLACE_M, Departures
from drone_mesh.formations.layouts import Layouts
from drone_mesh.state.model import MeshStatus, NodeStatus

LAYOUTS = Layouts.shipped()
LOOK_S = 1.0  # between two states of the mesh
STEP_S = 0.02  # a climbing drone moves 0.2 m


class Fleet:
    """Kinematic drones that are always connected and set out up to 3 s after their order."""

    def __init__(self, routers, seed):
        self.rng = random.Random(seed)
        self.nodes = {
            p.node_id: NodeStatus(
                p.node_id, p.role, connected=True, position=(p.longitude, p.latitude, 0.0)
            )
            for p in plan_fleet(1, routers, 6, 1.0)
        }
        self.now_s = 0.0
        self.under_order = {}  # drone -> place, when it sets out
        self.flights = {}
        self.row = {n: row for row, n in enumerate(self.nodes)}
        self.places = np.array([node.position for node in self.nodes.values()])
        self.nearest_m = np.inf

    def fly(self, goals, within_s):
        """Fly to these places; returns the drones that are elsewhere when nobody sets out."""
        until_s = self.now_s + within_s
        while self.now_s < until_s:
            away = {n: g for n, g in goals.items() if not self.is_at(n, g)}
            sent = {n: to for n, (to, _at_s) in self.under_order.items()}
            for drone, node in self.nodes.items():
                left = self.flights[drone].ahead(self.now_s) if drone in self.flights else ()
                node.path = tuple(value for corner in left for value in corner)
            mesh = MeshStatus(self.now_s, list(self.nodes.values()))
            free = away.keys() - sent.keys() - self.flights.keys()
            chosen = Departures(mesh, goals, sent).choose(free).set_out
            for drone, to in chosen.items():
                self.under_order[drone] = to, self.now_s + self.rng.uniform(0.0, 3.0)
            if not (self.under_order or self.flights):
                break
            for _ in range(round(LOOK_S / STEP_S)):
                self.step()
        return sorted(n for n, g in goals.items() if not self.is_at(n, g))

    def is_at(self, drone, goal):
        return Location.from_vector(self.nodes[drone].position).distance_m(goal) <= AT_PLACE_M

    def step(self):
        self.now_s += STEP_S
        for drone, (to, at_s) in list(self.under_order.items()):
            if self.now_s >= at_s:
                del self.under_order[drone]
                start, goal = self.nodes[drone].position, to.to_vector()
                self.flights[drone] = FlightPath(start, goal, self.now_s, SPEED_M_S)
        moving = list(self.flights)
        for drone in moving:
            path = self.flights[drone]
            self.nodes[drone].position = path.position_at(self.now_s)
            self.places[self.row[drone]] = self.nodes[drone].position
            if path.share_flown(self.now_s) >= 1.0:
                del self.flights[drone]
        if moving:
            rows = [self.row[n] for n in moving]
            apart = np.linalg.norm(self.places[rows][:, None] - self.places, axis=2)
            apart[range(len(rows)), rows] = np.inf
            self.nearest_m = min(self.nearest_m, float(apart.min()))


@pytest.mark.parametrize(
    ("routers", "cases"),
    [
        pytest.param(17, [0, 102, 100, 202, 0, 101], marks=pytest.mark.slow),
        pytest.param(253, [100], marks=pytest.mark.slow),
        pytest.param(253, [0], marks=pytest.mark.slow),
    ],
)
def test_no_two_drones_come_nearer_than_1_m(routers, cases):
    fleet = Fleet(routers, seed=1)
    for case in cases:
        goals = {n: goal for n, goal in LAYOUTS.orders(case) if n in fleet.nodes}
        elsewhere = fleet.fly(goals, within_s=600.0)
        # With 253 drones at their start, some stand on places of the grid; nobody flies there.
        assert (elsewhere == []) is (routers == 17)
    assert fleet.nearest_m >= 1.0 - 1e-6


def test_drones_that_fly_in_a_circle_to_the_place_of_the_next_do_not_meet():
    fleet = Fleet(6, seed=2)
    places = {n: Location.from_vector(fleet.nodes[n].position) for n in range(1, 7)}
    ring = [1, 2, 3, 4, 5, 6]
    goals = {n: places[ring[(k + 1) % 6]] for k, n in enumerate(ring)}
    assert fleet.fly(goals, within_s=300.0) == []
    assert fleet.nearest_m >= 1.0 - 1e-6
