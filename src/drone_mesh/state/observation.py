"""What hosts and the world report, as NodeStatus and EventRecord; MeshRoster merges it."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass
from typing import TYPE_CHECKING, Iterable, Sequence

from drone_mesh.air.obstacles import Box
from drone_mesh.communication.control.router_states import RepairState
from drone_mesh.communication.events.observer import MeshEvent, MeshEventKind
from drone_mesh.communication.interfaces import NO_ROUTE
from drone_mesh.communication.repair.status import NOTHING_TO_REPAIR
from drone_mesh.drone.battery import Endurance
from drone_mesh.drone.fence import Fence
from drone_mesh.drone.flight_path import FlightPath, Vector
from drone_mesh.drone.roles import Role
from drone_mesh.state.links import route_to_gateway
from drone_mesh.state.model import (
    REPAIR_STATES,
    UNKNOWN_POSITION,
    AreaStatus,
    EventRecord,
    NodeStatus,
    ObstacleStatus,
)

if TYPE_CHECKING:  # programs that only show a mesh, or order flights, do without a node's software
    from drone_mesh.communication.node.component import MeshnetworkComponent

_SEVERAL_AT_ONCE = (
    MeshEventKind.NEIGHBOUR_FOUND,
    MeshEventKind.NEIGHBOUR_LOST,
    MeshEventKind.NODE_MISSING,
)
EVENTS_KEPT = 100_000  # twice what 254 nodes that find 200 neighbours each produce
OLDEST_AGE_S = 255  # the largest value of one byte


class EventBatcher:
    """Accepts events from any thread; one thread takes them out in batches.

    When many nodes meet, they produce tens of thousands of events within a second. Consecutive
    events about neighbours that one node found (or lost, or misses) therefore become one event with
    many peers.
    """

    def __init__(self) -> None:
        self._waiting: deque[MeshEvent] = deque(maxlen=EVENTS_KEPT)  # append and popleft are atomic

    def observe(self, event: MeshEvent) -> None:
        """A MeshObserver. Beyond EVENTS_KEPT the oldest events are dropped."""
        self._waiting.append(event)

    def drain(self) -> list[EventRecord]:
        """All events since the last call, oldest first."""
        batch: list[tuple[MeshEvent, list[int]]] = []  # each with all its peers
        latest_of: dict[int, tuple[MeshEvent, list[int]]] = {}
        for _ in range(len(self._waiting)):
            event = self._waiting.popleft()
            peers = peers_of(event)
            latest, known = latest_of.get(event.node, (None, []))
            if latest is not None and latest.kind is event.kind and event.kind in _SEVERAL_AT_ONCE:
                known += [peer for peer in peers if peer not in known]
            else:
                latest_of[event.node] = event, peers
                batch.append((event, peers))
        return [record_of(event, peers) for event, peers in batch]


def peers_of(event: MeshEvent) -> list[int]:
    """Its peer, if there is one."""
    return [] if event.peer == NO_ROUTE else [event.peer]


def record_of(event: MeshEvent, peers: Iterable[int]) -> EventRecord:
    """This event, of several peers at once."""
    return EventRecord(
        event.now_s,
        event.node,
        event.kind.value,
        tuple(peers),
        event.detail,
        event.order,
        event.place,
    )


@dataclass(frozen=True)
class DroneView:
    """The world's data on one drone."""

    id: int
    role: int
    position: Sequence[float]  # (3,) m, map frame, of the underside
    path: Sequence[float] = ()  # (3 * waypoints,) m, the rest of its flight; empty: none
    heading: Sequence[float] = ()  # (3,) m, where its pilot flies it to; empty: nowhere
    battery: float = math.nan  # percent; NaN: it has none
    crashed: bool = False
    why_not_fly: str = ""  # empty: it can fly
    mission: str = ""  # in words; empty: none
    endurance: Endurance = Endurance()


class MeshRoster:
    """All nodes of the mesh, by host. Belongs to one thread; `wall_s` are seconds of wall time.

    A node leaves the roster when its host sends a report without it. If a host falls silent, its
    nodes remain and their report_age grows.
    """

    def __init__(self) -> None:
        self._nodes: dict[int, NodeStatus] = {}
        self._host_of: dict[int, str] = {}
        self._heard_at_s: dict[int, float] = {}

    def merge_report(self, host: str, nodes: Iterable[NodeStatus], wall_s: float) -> None:
        """Apply a report of `host`. A node that moved to another host belongs to the new one."""
        reported = {node.id: node for node in nodes}
        for node_id in [n for n, other in self._host_of.items() if other == host]:
            if node_id not in reported:
                self.forget(node_id)
        self._nodes.update(reported)
        self._host_of.update(dict.fromkeys(reported, host))
        self._heard_at_s.update(dict.fromkeys(reported, wall_s))

    def forget(self, node_id: int) -> None:
        """Drop this removed node; an unknown one is ignored."""
        for known in (self._nodes, self._host_of, self._heard_at_s):
            known.pop(node_id, None)

    def snapshot(self, drones: Iterable[DroneView], wall_s: float) -> list[NodeStatus]:
        """All nodes by id, with positions, paths, routes and report ages filled in.

        A drone that no host has reported yet, or whose battery is empty, is listed as switched off.
        The returned objects are not copies: the next call changes them.
        """
        views = {drone.id: drone for drone in drones}
        for node in self._nodes.values():
            view = views.get(node.id)
            node.position = view.position if view else UNKNOWN_POSITION
            node.path = view.path if view else ()
            node.heading = view.heading if view else ()
            if view is not None:
                node.battery, node.crashed = view.battery, view.crashed
                node.why_not_fly, node.mission = view.why_not_fly, view.mission
                node.time_left, node.home, node.pad = view.endurance
                node.on = node.on and view.battery != 0.0
            node.route = route_to_gateway(node.id, self._nodes)
            node.report_age = wall_s - self._heard_at_s[node.id]
        unreported = [
            NodeStatus(view.id, view.role, on=False, position=view.position, path=view.path)
            for view in views.values()
            if view.id not in self._nodes
        ]
        return sorted([*self._nodes.values(), *unreported], key=lambda node: node.id)


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
    status.outside_fence = component.outside_fence
    repair = component.get_repair_status() if on else NOTHING_TO_REPAIR
    status.repair, status.repair_reason = repair.in_words(now_s), repair.reason
    status.jammed = repair.jammed
    status.repair_state = REPAIR_STATES.index(repair.state)
    status.bid, status.place_of = repair.bid, repair.place_of
    waits = repair.state is RepairState.LOST
    status.emergency_in = repair.emergency_s - now_s if waits else math.inf
    heard_s = component.get_neighbours()
    status.neighbours = bytes(sorted(heard_s))
    ages_s = (now_s - heard_s[neighbour] for neighbour in status.neighbours)
    status.neighbour_ages = bytes([int(max(0.0, min(age_s, OLDEST_AGE_S))) for age_s in ages_s])


def describe_drone(
    node_id: int, role: Role, centre: Vector, path: FlightPath | None, now_s: float
) -> DroneView:
    """Fill in position and path of a simulated drone, given the centre of its box and its path."""
    half_height_m = role.size_m[2] / 2
    x, y, z = centre
    ahead = path_ahead(path, now_s, half_height_m) if path else ()
    return DroneView(node_id, role, (x, y, z - half_height_m), ahead)


def describe_obstacles(boxes: Iterable[Box]) -> list[ObstacleStatus]:
    return [ObstacleStatus(box.center, box.size, box.yaw_rad) for box in boxes]


def describe_fence(fence: Fence) -> list[AreaStatus]:
    return [
        AreaStatus(
            zone.name,
            inside,
            zone.lowest_m,
            zone.highest_m,
            [value for ring in zone.rings for corner in ring for value in corner],
            [len(ring) for ring in zone.rings],
        )
        for zone, inside in fence.zones
    ]


def path_ahead(path: FlightPath, now_s: float, lower_by_m: float = 0.0) -> tuple[float, ...]:
    """x y z of each waypoint that is still ahead, the goal last, in metres."""
    return tuple(value for x, y, z in path.ahead(now_s) for value in (x, y, z - lower_by_m))
