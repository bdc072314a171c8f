"""The graph of drones that can hear each other: parts, hops, cut vertices."""

from __future__ import annotations

import math
from collections import deque
from typing import Iterable, Mapping, Sequence

Adjacency = Mapping[int, Iterable[int]]


def within(points: Sequence[tuple[float, ...]], range_m: float) -> dict[int, list[int]]:
    """Neighbours of each point, by index: nearer than `range_m`."""
    near: dict[int, list[int]] = {index: [] for index in range(len(points))}
    for one in range(len(points)):
        for other in range(one):
            if math.dist(points[one], points[other]) < range_m:
                near[one].append(other)
                near[other].append(one)
    return near


class Graph:
    """An undirected graph of node ids."""

    def __init__(self, adjacency: Adjacency) -> None:
        self.near = {node: tuple(others) for node, others in adjacency.items()}

    def without(self, gone: Iterable[int]) -> Graph:
        """The graph without these nodes."""
        left = self.near.keys() - set(gone)
        return Graph({n: [o for o in self.near[n] if o in left] for n in self.near if n in left})

    def hops_from(self, sources: Iterable[int]) -> dict[int, int]:
        """Hops to the nearest source, for all nodes with a path to one."""
        hops = {node: 0 for node in sources if node in self.near}
        queue = deque(hops)
        while queue:
            node = queue.popleft()
            for other in self.near[node]:
                if other not in hops:
                    hops[other] = hops[node] + 1
                    queue.append(other)
        return hops

    def parts(self) -> list[set[int]]:
        """Connected components, each a set of ids, ordered by their first node."""
        seen: set[int] = set()
        found = []
        for node in self.near:
            if node not in seen:
                part = set(self.hops_from([node]))
                seen |= part
                found.append(part)
        return found

    def is_connected(self) -> bool:
        """Whether there is at most one part."""
        return not self.near or len(self.hops_from([next(iter(self.near))])) == len(self.near)

    def mean_degree(self) -> float:
        """Neighbours per node; 0 for no nodes."""
        return sum(map(len, self.near.values())) / len(self.near) if self.near else 0.0

    def cut_vertices(self, gateways: Iterable[int]) -> list[int]:
        """Nodes other than gateways whose loss cuts another node off from all gateways, by id."""
        roots = [node for node in gateways if node in self.near]
        reached = len(self.hops_from(roots))
        return [
            node
            for node in sorted(self.near)
            if node not in roots and len(self.near[node]) > 1
            if self._reached_without(roots, node) < reached - 1
        ]

    def _reached_without(self, roots: Sequence[int], gone: int) -> int:
        seen = {*roots, gone}
        stack = list(roots)
        while stack:
            for other in self.near[stack.pop()]:
                if other not in seen:
                    seen.add(other)
                    stack.append(other)
        return len(seen) - 1
