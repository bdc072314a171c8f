"""Watches the links of a moving mesh: how many change, how long they live, whom they serve."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import AbstractSet

from drone_mesh.air.graph import Graph
from drone_mesh.lab.network_sample import NetworkSample


@dataclass
class Lapses:
    """Of the routers that have a path, how many are in a state that they should be in."""

    shares: list[float] = field(default_factory=list)  # of each sample
    lapses_s: list[float] = field(default_factory=list)  # times with a path, but not in that state
    _since_s: dict[int, float] = field(default_factory=dict, repr=False)  # node -> of its lapse

    def look(self, now_s: float, reachable: AbstractSet[int], well: AbstractSet[int]) -> None:
        """Take one sample: the routers that have a path, and those in that state."""
        lapsing = reachable - well
        if reachable:
            self.shares.append(1.0 - len(lapsing) / len(reachable))
        for node in self._since_s.keys() - lapsing:  # well again, off, or without any path
            self.lapses_s.append(now_s - self._since_s.pop(node))
        for node in lapsing - self._since_s.keys():
            self._since_s[node] = now_s


@dataclass
class LinkWatch:
    """Sums over the samples of a run, from `from_s` on."""

    from_s: float
    drone_s: float = 0.0  # live drones, gateways included, times seconds
    link_s: float = 0.0  # links times seconds
    appeared: int = 0
    disappeared: int = 0
    router_s: float = 0.0  # live routers times seconds
    reachable_s: float = 0.0  # of these, with a path over existing links
    served_s: float = 0.0  # of these, served
    service: Lapses = field(default_factory=Lapses)
    connection: Lapses = field(default_factory=Lapses)
    _links: set[tuple[int, int]] | None = field(default=None, repr=False)
    _last_s: float = field(default=0.0, repr=False)

    def look(self, sample: NetworkSample, graph: Graph, gateways: list[int]) -> None:
        """Take one sample; a link that lives shorter than the sampling period is missed."""
        if sample.now_s < self.from_s:
            return
        links = {(a, b) for a, others in graph.near.items() for b in others if a < b}
        if self._links is not None:
            passed_s = sample.now_s - self._last_s
            reachable = sample.alive & graph.hops_from(gateways).keys()
            self.drone_s += len(graph.near) * passed_s
            self.link_s += len(links) * passed_s
            self.appeared += len(links - self._links)
            self.disappeared += len(self._links - links)
            self.router_s += len(sample.alive) * passed_s
            self.reachable_s += len(reachable) * passed_s
            self.served_s += len(sample.served & reachable) * passed_s
            self.service.look(sample.now_s, reachable, sample.served)
            self.connection.look(sample.now_s, reachable, sample.connected)
        self._links, self._last_s = links, sample.now_s
