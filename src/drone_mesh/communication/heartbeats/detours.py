"""Detours: which neighbours a router avoids on its way to the gateway, and for how long."""

from __future__ import annotations

import math

from drone_mesh.communication.interfaces import NO_ROUTE
from drone_mesh.communication.neighbours.neighbour_table import Neighbours

AVOIDED_S = 60.0  # for a neighbour through which no answer came
SWALLOWER_AVOIDED_S = 600.0  # for a neighbour that seems to swallow packets


class Detours:
    """The neighbours that a router avoids on its way to the gateway, and the alternatives."""

    def __init__(self, neighbours: Neighbours) -> None:
        self._neighbours = neighbours
        self._until_s: dict[int, float] = {}  # by neighbour

    def avoid(self, neighbour: int, until_s: float) -> None:
        """Avoid this neighbour until then, because no answer came through it."""
        self._until_s[neighbour] = until_s

    def avoid_none(self) -> None:
        """Avoid no neighbour any longer, because there is no better one."""
        self._until_s.clear()

    def avoids(self, neighbour: int, now_s: float) -> bool:
        """Whether to avoid this neighbour now."""
        return now_s < self._until_s.get(neighbour, -math.inf)

    def passes_by(self, neighbour: int, now_s: float) -> bool:
        """Whether to avoid it and use another neighbour that has a gateway."""
        return self.avoids(neighbour, now_s) and bool(self._others(neighbour, now_s))

    def nearest(self, but: int, hops: int, now_s: float) -> int:
        """The nearest other neighbour, with at most `hops` hops to the gateway; or NO_ROUTE.

        A neighbour with more hops may use this node to reach the gateway.
        """
        nearest_hops, node = min(self._others(but, now_s), default=(NO_ROUTE, NO_ROUTE))
        return node if nearest_hops <= hops else NO_ROUTE

    def _others(self, but: int, now_s: float) -> list[tuple[int, int]]:
        """Hops and id of the neighbours that have a gateway and are not avoided."""
        hops_of = self._neighbours.hops_of
        nodes = [node for node in self._neighbours.ids() if not self.avoids(node, now_s)]
        return [(hops_of(node), node) for node in nodes if node != but and hops_of(node) < NO_ROUTE]
