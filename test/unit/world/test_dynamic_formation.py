"""Drones of a formation that physics moves."""

from __future__ import annotations

import math

import pytest

from drone_mesh.drone.location import Location
from drone_mesh.drone.roles import Role
from drone_mesh.formations.airspace import APART_M, SWAY_M
from drone_mesh.formations.departures import AT_PLACE_M, Departures, FlightRules
from drone_mesh.state.model import MeshStatus, NodeStatus
from drone_mesh.state.observation import describe_drone
from drone_mesh.world.body import BodyLimits
from drone_mesh.world.bullet_world import BulletWorld
from drone_mesh.world.dynamic_engine import DynamicEngine

HALF_M = Role.ROUTER.size_m[2] / 2
RULES = FlightRules(sway_m=SWAY_M)


def mesh(engines: dict[int, DynamicEngine], now_s: float) -> MeshStatus:
    nodes = [NodeStatus(0, Role.GATEWAY, connected=True, position=(-5.0, 0.0, 0.0))]
    for drone, engine in engines.items():
        state = engine.state
        view = describe_drone(drone, Role.ROUTER, state.position, state.path, now_s)
        nodes.append(
            NodeStatus(drone, connected=True, position=view.position, path=tuple(view.path))
        )
    return MeshStatus(now_s, nodes)


@pytest.mark.slow
def test_dynamic_drones_that_change_places_stay_1_m_apart():
    places = [(2.0 * (n % 3), 2.0 * (n // 3), HALF_M) for n in range(9)]
    with BulletWorld() as world:
        engines = {}
        for drone, place in enumerate(places, start=1):
            box = world.add_body(Role.ROUTER.size_m, place, BodyLimits().mass_kg)
            engines[drone] = DynamicEngine(world, box, place, HALF_M, wind=(1.0, 0.5, 0.0))
        goals = {
            drone: Location.from_vector((*places[(drone + 3) % 9][:2], 0.0)) for drone in engines
        }
        nearest_m, under_order = math.inf, {}
        for tick in range(40_000):
            if tick % 50 == 0:
                state = mesh(engines, world.now_s)
                for node in state.nodes:
                    if len(node.path):
                        under_order.pop(node.id, None)
                at = {drone: engine.get_location() for drone, engine in engines.items()}
                away = {d for d, goal in goals.items() if at[d].distance_m(goal) > AT_PLACE_M}
                flying = {node.id for node in state.nodes if len(node.path)}
                if not away and not flying:
                    break
                chosen = Departures(state, goals, under_order, RULES).choose(away - flying).set_out
                for drone, to in chosen.items():
                    engines[drone].set_goal(*to)
                    under_order[drone] = to
            world.step()
            if tick % 5 == 0:
                now = [engine.state.position for engine in engines.values()]
                nearest_m = min(
                    nearest_m, *(math.dist(a, b) for i, a in enumerate(now) for b in now[:i])
                )
        assert away == set()
        assert not any(engine.crashed for engine in engines.values())
        assert nearest_m >= APART_M
