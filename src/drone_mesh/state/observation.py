"""Describes a mesh component and a drone in the terms of a NodeStatus."""

from __future__ import annotations

import math
from typing import Iterable

import numpy as np

from drone_mesh.air.obstacles import Box
from drone_mesh.communication.control.router_states import RepairState
from drone_mesh.communication.interfaces import NO_ROUTE
from drone_mesh.communication.node.component import MeshnetworkComponent
from drone_mesh.communication.repair.status import NOTHING_TO_REPAIR
from drone_mesh.drone.flight_path import FlightPath, Vector
from drone_mesh.drone.roles import Role
from drone_mesh.state.model import REPAIR_STATES, NodeStatus, ObstacleStatus
from drone_mesh.state.roster import DroneView

OLDEST_AGE_S = 255  # the largest value of one byte


def describe_component(
    status: NodeStatus, component: MeshnetworkComponent, on: bool, now_s: float
) -> None:
    """Fill in the state of a component. May be called in any thread.

    `on` is whether its antenna has power. Position, path, route and report_age remain unchanged.
    """
    status.on = on
    status.connected = component.get_connected_to_gateway()
    status.gateway = component.get_preferred_gateway()
    status.hops = component.get_hops_from_gateway_away()
    status.next_hop = component.get_route_to_gateway()
    status.fallback = component.get_last_good_known_location_id()
    fallback_age_s = now_s - component.get_last_good_known_location_seen_s()
    status.fallback_age = math.nan if status.fallback == NO_ROUTE else fallback_age_s
    status.shares_id = component.get_shares_id()
    status.known_nodes = component.get_router_tech_table_size()
    status.total_messages = component.get_total_message_sent()
    use = component.get_channel_use()
    status.airtime, status.tries = use.airtime, use.tries
    status.queue, status.given_up = use.waiting, use.given_up
    data = component.data.figures()
    status.data_sent, status.data_bytes_sent = data.messages_sent, data.bytes_sent
    status.data_received, status.data_bytes_received = data.messages_received, data.bytes_received
    status.data_sent_at, status.data_received_at = data.sent_s, data.received_s
    status.data_queued, status.data_given_up = data.messages_queued, data.messages_given_up
    repair = component.get_repair_status() if on else NOTHING_TO_REPAIR
    status.repair, status.repair_reason = repair.in_words(now_s), repair.reason
    status.jammed = repair.jammed
    status.repair_state = REPAIR_STATES.index(repair.state)
    status.bid, status.place_of = repair.bid, repair.place_of
    waits = repair.state is RepairState.LOST
    status.emergency_in = repair.emergency_s - now_s if waits else math.inf
    heard_s = component.get_neighbours()
    # numpy, because a crowd of 254 has 36,000 neighbours to list twice a second.
    ids = np.fromiter(heard_s, np.uint8, len(heard_s))
    ages_s = now_s - np.fromiter(heard_s.values(), float, len(heard_s))
    by_id = ids.argsort()
    status.neighbours = ids[by_id].tobytes()
    status.neighbour_ages = ages_s.clip(0, OLDEST_AGE_S).astype(np.uint8)[by_id].tobytes()


def describe_drone(
    node_id: int, role: Role, centre: Vector, path: FlightPath | None, now_s: float
) -> DroneView:
    """Fill in position and path of a simulated drone, given the centre of its box and its path."""
    half_height_m = role.size_m[2] / 2
    x, y, z = centre
    ahead = path_ahead(path, now_s, half_height_m) if path else ()
    return DroneView(node_id, role, (x, y, z - half_height_m), ahead)


def describe_obstacles(boxes: Iterable[Box]) -> list[ObstacleStatus]:
    """These boxes as parts of a MeshStatus."""
    return [ObstacleStatus(box.center, box.size, box.yaw_rad) for box in boxes]


def path_ahead(path: FlightPath, now_s: float, lower_by_m: float = 0.0) -> tuple[float, ...]:
    """x y z of each waypoint that is still ahead, the goal last, in metres."""
    return tuple(value for x, y, z in path.ahead(now_s) for value in (x, y, z - lower_by_m))
