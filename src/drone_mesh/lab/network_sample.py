"""Observes a network from outside: which nodes could reach a gateway, which do, and its links."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import AbstractSet

from drone_mesh.air.graph import Graph
from drone_mesh.communication.interfaces import NO_ROUTE
from drone_mesh.inprocess import Network


@dataclass(frozen=True)
class NetworkSample:
    """The network at one moment."""

    now_s: float
    alive: frozenset[int]  # routers whose antenna has power
    connected: frozenset[int]  # of these, the ones that consider themselves connected
    served: frozenset[int]  # of these, the ones with a working path

    @property
    def share(self) -> float:
        """Share of live routers that are served; 1 if none is alive."""
        return len(self.served) / len(self.alive) if self.alive else 1.0


def sample_of(network: Network) -> NetworkSample:
    """Observe the network now. A stale route does not count as service.

    A router is served while it considers itself connected and its chain of next hops leads to a
    gateway over links that exist now.
    """
    nodes = network.nodes
    leads = {n: node.antenna.powered for n, node in nodes.items() if node.is_gateway}
    alive = [n for n, node in nodes.items() if node.antenna.powered and not node.is_gateway]
    connected = [n for n in alive if nodes[n].component.get_connected_to_gateway()]
    served = [n for n in connected if _leads(network, n, leads)]
    return NetworkSample(
        network.clock.now_s, frozenset(alive), frozenset(connected), frozenset(served)
    )


def _leads(network: Network, start: int, leads: dict[int, bool]) -> bool:
    """Whether the next hops from here lead to a gateway; stores the result for nodes on the way."""
    nodes = network.nodes
    chain = []
    node_id = start
    while node_id not in leads:
        leads[node_id] = False  # a loop ends here
        chain.append(node_id)
        step = nodes[node_id].component.get_route_to_gateway()
        if step == NO_ROUTE or step not in nodes or not nodes[step].antenna.powered:
            return False
        if step not in network.air.in_range(node_id) or not _both_ways(network, node_id, step):
            return False
        node_id = step
    result = leads[node_id]
    for passed in chain:
        leads[passed] = result
    return result


def _both_ways(network: Network, one: int, other: int) -> bool:
    """Whether two nodes in range of each other are neither deaf nor mute to each other."""
    hears = network.air.hears
    return hears is None or (hears(one, other) and hears(other, one))


def route_hops(network: Network, served: frozenset[int]) -> dict[int, int]:
    """Hops of the route of each served router, but for those that have lost theirs since."""
    hops = {node_id: 0 for node_id, node in network.nodes.items() if node.is_gateway}
    for start in served:
        chain: list[int] = []
        node_id = start
        while node_id not in hops and node_id in network.nodes and node_id not in chain:
            chain.append(node_id)
            node_id = network.nodes[node_id].component.get_route_to_gateway()
        if node_id in hops:
            below = hops[node_id]
            for distance, passed in enumerate(reversed(chain), start=1):
                hops[passed] = below + distance
    return {node: hops[node] for node in served if node in hops}


def physical_graph(network: Network) -> Graph:
    """The pairs of powered nodes that could hear each other now, known to them or not."""
    powered = [node_id for node_id, node in network.nodes.items() if node.antenna.powered]
    alive = set(powered)
    return Graph(
        {
            node_id: [
                other
                for other in network.air.in_range(node_id)
                if other in alive and _both_ways(network, node_id, other)
            ]
            for node_id in powered
        }
    )


def gateways_of(network: Network) -> list[int]:
    """All gateways, on or off."""
    return [node_id for node_id, node in network.nodes.items() if node.is_gateway]


@dataclass
class Lapses:
    """How many of the routers that have a path are in the state that they should be in."""

    shares: list[float] = field(default_factory=list)  # of each sample
    _ended_s: list[float] = field(default_factory=list, repr=False)  # lengths of lapses
    _since_s: dict[int, float] = field(default_factory=dict, repr=False)  # node -> of its lapse

    def look(self, now_s: float, reachable: AbstractSet[int], well: AbstractSet[int]) -> None:
        """Take one sample: the routers that have a path, and those in that state."""
        lapsing = reachable - well
        if reachable:
            self.shares.append(1.0 - len(lapsing) / len(reachable))
        for node in self._since_s.keys() - lapsing:  # well again, off, or without any path
            self._ended_s.append(now_s - self._since_s.pop(node))
        for node in lapsing - self._since_s.keys():
            self._since_s[node] = now_s

    def lapses_s(self, end_s: float) -> list[float]:
        """How long routers had a path and were not in that state; without an end: up to `end_s`."""
        return [*self._ended_s, *(end_s - since_s for since_s in self._since_s.values())]


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
