"""Merging what hosts report with what the world sees."""

from __future__ import annotations

import math

from drone_mesh.drone.roles import Role
from drone_mesh.state.model import NodeStatus
from drone_mesh.state.observation import DroneView, MeshRoster


def gateway_and_router() -> list[NodeStatus]:
    return [
        NodeStatus(1, connected=True, next_hop=0),
        NodeStatus(0, Role.GATEWAY, connected=True, next_hop=0),
    ]


def test_a_snapshot_has_places_flights_and_routes_by_id():
    roster = MeshRoster()
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


def test_a_host_that_falls_silent_keeps_its_nodes_and_they_age():
    roster = MeshRoster()
    roster.merge_report("first", [NodeStatus(1)], wall_s=0.0)
    roster.merge_report("second", [NodeStatus(2)], wall_s=30.0)
    ages = {node.id: node.report_age for node in roster.snapshot([], wall_s=30.0)}
    assert ages == {1: 30.0, 2: 0.0}


def test_a_node_that_its_host_no_longer_reports_is_gone():
    roster = MeshRoster()
    roster.merge_report("host", [NodeStatus(1), NodeStatus(2)], wall_s=0.0)
    roster.merge_report("host", [NodeStatus(2)], wall_s=1.0)
    assert [node.id for node in roster.snapshot([], wall_s=1.0)] == [2]


def test_a_node_that_moved_to_another_host_survives_the_end_of_the_first():
    roster = MeshRoster()
    roster.merge_report("first", [NodeStatus(1), NodeStatus(2)], wall_s=0.0)
    roster.merge_report("second", [NodeStatus(1)], wall_s=1.0)
    roster.merge_report("first", [NodeStatus(2)], wall_s=2.0)
    roster.merge_report("first", [], wall_s=3.0)
    assert [node.id for node in roster.snapshot([], wall_s=3.0)] == [1]


def test_a_node_without_a_drone_has_no_place_and_a_drone_without_a_report_is_switched_off():
    roster = MeshRoster()
    roster.merge_report("host", [NodeStatus(7)], wall_s=0.0)
    drone, node = roster.snapshot([DroneView(3, Role.ROUTER, (1.0, 2.0, 0.0))], wall_s=0.0)
    assert (drone.id, drone.on, drone.position) == (3, False, (1.0, 2.0, 0.0))
    assert all(map(math.isnan, node.position))


def test_a_node_that_was_removed_is_gone_even_if_its_host_fell_silent():
    roster = MeshRoster()
    roster.merge_report("host", gateway_and_router(), wall_s=0.0)
    roster.forget(1)
    roster.forget(9)
    assert [node.id for node in roster.snapshot([], wall_s=1.0)] == [0]
    roster.merge_report("host", [], wall_s=2.0)
    assert roster.snapshot([], wall_s=2.0) == []
