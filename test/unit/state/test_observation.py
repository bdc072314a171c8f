"""Observing real components and drones."""

from __future__ import annotations

import pytest

from drone_mesh.drone.flight_path import FlightPath
from drone_mesh.drone.roles import Role
from drone_mesh.inprocess import Network
from drone_mesh.state.model import NodeStatus
from drone_mesh.state.observation import describe_component, describe_drone, path_ahead


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
    assert (status.next_hop, status.fallback) == (1, 1)
    assert 0.0 <= status.fallback_age <= 21.0
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
    assert status.fallback_age == pytest.approx(1e6, abs=20.0)


def test_a_drone_is_described_by_its_underside_and_the_rest_of_its_path():
    path = FlightPath((0.0, 0.0, 0.05), (0.0, 8.0, 1.05), start_s=0.0)
    view = describe_drone(1, Role.ROUTER, (0.0, 0.0, 0.05), path, now_s=0.0)
    assert (view.id, view.role) == (1, Role.ROUTER)
    assert view.position == pytest.approx((0.0, 0.0, 0.0))
    assert view.path[-3:] == pytest.approx((0.0, 8.0, 1.0))
    assert len(view.path) == 9


@pytest.mark.parametrize(("now_s", "waypoints"), [(0.0, 3), (0.6, 2), (4.6, 1), (9.9, 1)])
def test_waypoints_that_were_passed_are_not_ahead(now_s, waypoints):
    path = FlightPath((0.0, 0.0, 0.0), (10.0, 0.0, 0.0), start_s=0.0)
    assert len(path_ahead(path, now_s)) == 3 * waypoints
    assert path_ahead(path, now_s)[-3:] == (10.0, 0.0, 0.0)
