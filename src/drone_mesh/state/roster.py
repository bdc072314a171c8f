"""MeshRoster: merges the reports of the hosts with the world's data on the drones."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Iterable, Sequence

from drone_mesh.state.model import UNKNOWN_POSITION, NodeStatus
from drone_mesh.state.routes import route_to_gateway


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
                node.why_not_fly = view.why_not_fly
                node.on = node.on and view.battery != 0.0
            node.route = route_to_gateway(node.id, self._nodes)
            node.report_age = wall_s - self._heard_at_s[node.id]
        unreported = [
            NodeStatus(view.id, view.role, on=False, position=view.position, path=view.path)
            for view in views.values()
            if view.id not in self._nodes
        ]
        return sorted([*self._nodes.values(), *unreported], key=lambda node: node.id)
