"""Watches the links of a moving mesh: how many change, how long they live, whom they serve."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import AbstractSet

from drone_mesh.air.graph import Graph
from drone_mesh.lab.network_sample import NetworkSample


@dataclass
class LinkWatch:
    """Sums over the samples of a run, from `from_s` on."""

    from_s: float
    seconds: float = 0.0  # of observation
    drone_s: float = 0.0  # live drones, gateways included, times seconds
    link_s: float = 0.0  # links times seconds
    appeared: int = 0
    disappeared: int = 0
    router_s: float = 0.0  # live routers times seconds
    reachable_s: float = 0.0  # of these, with a path over existing links
    served_s: float = 0.0  # of these, served
    shares: list[float] = field(default_factory=list)  # of each sample: served of those with a path
    lapses_s: list[float] = field(default_factory=list)  # times with a path, but not served
    _lapsing: dict[int, float] = field(default_factory=dict, repr=False)  # node -> since when
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
            self.seconds += passed_s
            self.drone_s += len(graph.near) * passed_s
            self.link_s += len(links) * passed_s
            self.appeared += len(links - self._links)
            self.disappeared += len(self._links - links)
            self.router_s += len(sample.alive) * passed_s
            self.reachable_s += len(reachable) * passed_s
            self.served_s += len(sample.served & reachable) * passed_s
            self._follow_lapses(sample, reachable)
        self._links, self._last_s = links, sample.now_s

    def _follow_lapses(self, sample: NetworkSample, reachable: AbstractSet[int]) -> None:
        lapsing = reachable - sample.served
        if reachable:
            self.shares.append(1.0 - len(lapsing) / len(reachable))
        for node in self._lapsing.keys() - lapsing:  # served again, off, or without any path
            self.lapses_s.append(sample.now_s - self._lapsing.pop(node))
        for node in lapsing - self._lapsing.keys():
            self._lapsing[node] = sample.now_s
