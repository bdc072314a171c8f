"""Looking at real components and drones."""

from __future__ import annotations

import pytest

from drone_mesh.drone.flight_path import FlightPath
from drone_mesh.drone.roles import Role
from drone_mesh.inprocess import Network
from drone_mesh.state.model import NodeStatus
from drone_mesh.state.observation import describe_component, view_drone, way_ahead
from drone_mesh.world.factory import DroneFactory
from drone_mesh.world.still_world import StillWorld


def test_a_router_two_hops_away_is_described_as_it_is():
    network = Network(seed=1)
    network.add_gateway(0, 0.0, 0.0)
    network.add_router(1, 6.0, 0.0)
    network.add_router(2, 12.0, 0.0)
    assert network.run_until(network.all_connected, within_s=15.0)
    network.run_for(21.0)
    status = NodeStatus(2)
    describe_component(status, network.nodes[2].component, True, network.clock.now_s)
    assert (status.on, status.connected, status.gateway, status.hops) == (True, True, 0, 2)
    assert (status.next_hop, status.pref_loc) == (1, 1)
    assert status.neighbours == bytes([1])
    assert status.neighbour_ages[0] <= 10
    assert status.total_messages > 0


def test_an_age_beyond_a_byte_stays_at_its_end():
    network = Network(seed=1)
    network.add_gateway(0, 0.0, 0.0)
    network.add_router(1, 6.0, 0.0)
    assert network.run_until(network.all_connected, within_s=15.0)
    status = NodeStatus(1)
    describe_component(status, network.nodes[1].component, True, network.clock.now_s + 1e6)
    assert status.neighbour_ages == bytes([255])


def test_a_drone_is_seen_at_its_underside_and_with_the_rest_of_its_way():
    with StillWorld() as world:
        factory = DroneFactory(world, 1, 1, 6, 1.0, debug=False)
        gateway, router = factory.drones
        assert view_drone(gateway, world.now_s).position == pytest.approx((-1.0, 0.0, 0.0))
        router.engine.set_goal(latitude=8.0, longitude=0.0, height=1.0)
        world.step()
        view = view_drone(router, world.now_s)
        assert view.role == Role.ROUTER
        assert view.path[-3:] == pytest.approx((0.0, 8.0, 1.0))
        assert len(view.path) == 9


@pytest.mark.parametrize(("now_s", "corners"), [(0.0, 3), (0.6, 2), (4.6, 1), (9.9, 1)])
def test_corners_that_were_passed_are_not_ahead(now_s, corners):
    path = FlightPath((0.0, 0.0, 0.0), (10.0, 0.0, 0.0), start_s=0.0)
    assert len(way_ahead(path, now_s)) == 3 * corners
    assert way_ahead(path, now_s)[-3:] == (10.0, 0.0, 0.0)
