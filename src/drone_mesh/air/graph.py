"""The graph of drones that can hear each other: parts, hops, cut vertices."""

from __future__ import annotations

import math
from collections import deque
from typing import AbstractSet, Callable, Iterable, Mapping, Sequence


def hops_from(
    sources: Iterable[int],
    near: Callable[[int], Iterable[int]],
    without: AbstractSet[int] = frozenset(),
) -> dict[int, int]:
    """Hops to the nearest source, for all nodes with a path to one that avoids `without`."""
    hops = dict.fromkeys(sources, 0)
    queue = deque(hops)
    while queue:
        node = queue.popleft()
        for other in near(node):
            if other not in hops and other not in without:
                hops[other] = hops[node] + 1
                queue.append(other)
    return hops


def within(points: Mapping[int, Sequence[float]], range_m: float) -> dict[int, list[int]]:
    """Neighbours of each point: nearer than `range_m`."""
    near: dict[int, list[int]] = {node: [] for node in points}
    nodes = list(points)
    for place, one in enumerate(nodes):
        for other in nodes[:place]:
            if math.dist(points[one], points[other]) < range_m:
                near[one].append(other)
                near[other].append(one)
    return near


class Graph:
    """An undirected graph of node ids."""

    def __init__(self, adjacency: Mapping[int, Iterable[int]]) -> None:
        self.near = {node: tuple(others) for node, others in adjacency.items()}

    def without(self, gone: Iterable[int]) -> Graph:
        """The graph without these nodes."""
        left = self.near.keys() - set(gone)
        return Graph({n: [o for o in self.near[n] if o in left] for n in self.near if n in left})

    def hops_from(
        self, sources: Iterable[int], without: AbstractSet[int] = frozenset()
    ) -> dict[int, int]:
        """Hops to the nearest source, for all nodes with a path to one that avoids `without`."""
        return hops_from((n for n in sources if n in self.near), self.near.__getitem__, without)

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
            if len(self.hops_from(roots, {node})) < reached - 1
        ]
