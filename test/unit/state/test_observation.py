"""Observing components, drones and events, and merging what hosts report."""

from __future__ import annotations

import math

import pytest

from drone_mesh.communication.events.observer import MeshEvent, MeshEventKind
from drone_mesh.drone.flight_path import FlightPath
from drone_mesh.drone.roles import Role
from drone_mesh.inprocess import Network
from drone_mesh.state.model import NodeStatus
from drone_mesh.state.observation import (
    DroneView,
    EventBatcher,
    MeshRoster,
    describe_component,
    describe_drone,
    path_ahead,
)


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


FOUND, LOST = MeshEventKind.NEIGHBOUR_FOUND, MeshEventKind.NEIGHBOUR_LOST


def batch(*events: MeshEvent) -> list[tuple[int, str, tuple[int, ...]]]:
    batcher = EventBatcher()
    for event in events:
        batcher.observe(event)
    return [(event.node, event.kind, event.peers) for event in batcher.drain()]


def test_neighbours_found_one_after_the_other_are_one_event():
    assert batch(
        MeshEvent(FOUND, 1, 0.0, 5), MeshEvent(FOUND, 2, 0.0, 5), MeshEvent(FOUND, 1, 0.1, 6)
    ) == [(1, "neighbour found", (5, 6)), (2, "neighbour found", (5,))]


def test_found_lost_and_found_again_stays_in_order():
    assert batch(
        MeshEvent(FOUND, 1, 0.0, 5), MeshEvent(LOST, 1, 0.1, 5), MeshEvent(FOUND, 1, 0.2, 5)
    ) == [
        (1, "neighbour found", (5,)),
        (1, "neighbour lost", (5,)),
        (1, "neighbour found", (5,)),
    ]


def test_other_events_stay_apart():
    connected = MeshEvent(MeshEventKind.CONNECTED, 1, 0.0, 0)
    assert batch(connected, connected) == [(1, "connected", (0,)), (1, "connected", (0,))]


def test_an_event_without_another_node_has_no_peers():
    assert batch(MeshEvent(MeshEventKind.LANDED, 4, 0.0)) == [(4, "landed", ())]


def test_each_event_is_taken_once():
    batcher = EventBatcher()
    batcher.observe(MeshEvent(MeshEventKind.LANDED, 4, 12.5, detail="soft"))
    (event,) = batcher.drain()
    assert (event.stamp_s, event.detail) == (12.5, "soft")
    assert batcher.drain() == []


def gateway_and_router() -> list[NodeStatus]:
    return [
        NodeStatus(1, connected=True, next_hop=0),
        NodeStatus(0, Role.GATEWAY, connected=True, next_hop=0),
    ]


@pytest.fixture
def roster():
    return MeshRoster()


def test_a_snapshot_has_places_flights_and_routes_by_id(roster):
    roster.merge_report("host", gateway_and_router(), wall_s=10.0)
    drones = [
        DroneView(0, Role.GATEWAY, (-1.0, 0.0, 0.0)),
        DroneView(1, Role.ROUTER, (3.0, 4.0, 5.0), (3.0, 4.0, 0.0)),
    ]
    nodes = roster.snapshot(drones, wall_s=10.5)
    assert [node.id for node in nodes] == [0, 1]
    assert nodes[1].position == (3.0, 4.0, 5.0)
    assert nodes[1].path == (3.0, 4.0, 0.0)
    assert nodes[1].route == bytes([1, 0])
    assert nodes[1].report_age == 0.5


def test_a_host_that_falls_silent_keeps_its_nodes_and_they_age(roster):
    roster.merge_report("first", [NodeStatus(1)], wall_s=0.0)
    roster.merge_report("second", [NodeStatus(2)], wall_s=30.0)
    ages = {node.id: node.report_age for node in roster.snapshot([], wall_s=30.0)}
    assert ages == {1: 30.0, 2: 0.0}


def test_a_node_that_its_host_no_longer_reports_is_gone(roster):
    roster.merge_report("host", [NodeStatus(1), NodeStatus(2)], wall_s=0.0)
    roster.merge_report("host", [NodeStatus(2)], wall_s=1.0)
    assert [node.id for node in roster.snapshot([], wall_s=1.0)] == [2]


def test_a_node_that_moved_to_another_host_survives_the_end_of_the_first(roster):
    roster.merge_report("first", [NodeStatus(1), NodeStatus(2)], wall_s=0.0)
    roster.merge_report("second", [NodeStatus(1)], wall_s=1.0)
    roster.merge_report("first", [NodeStatus(2)], wall_s=2.0)
    roster.merge_report("first", [], wall_s=3.0)
    assert [node.id for node in roster.snapshot([], wall_s=3.0)] == [1]


def test_a_node_without_a_drone_has_no_place_and_a_drone_without_a_report_is_switched_off(roster):
    roster.merge_report("host", [NodeStatus(7)], wall_s=0.0)
    drone, node = roster.snapshot([DroneView(3, Role.ROUTER, (1.0, 2.0, 0.0))], wall_s=0.0)
    assert (drone.id, drone.on, drone.position) == (3, False, (1.0, 2.0, 0.0))
    assert all(map(math.isnan, node.position))


def test_a_node_that_was_removed_is_gone_even_if_its_host_fell_silent(roster):
    roster.merge_report("host", gateway_and_router(), wall_s=0.0)
    roster.forget(1)
    roster.forget(9)
    assert [node.id for node in roster.snapshot([], wall_s=1.0)] == [0]
    roster.merge_report("host", [], wall_s=2.0)
    assert roster.snapshot([], wall_s=2.0) == []
