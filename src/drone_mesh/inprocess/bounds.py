"""Bounds for routing and for repairs: techniques that need global knowledge of a network."""

from __future__ import annotations

from typing import Callable, Iterable, Mapping

from drone_mesh.air.graph import hops_from
from drone_mesh.communication.interfaces import NO_ROUTE
from drone_mesh.communication.repair.interfaces import IRepairStrategy, Step
from drone_mesh.communication.routing.child_table_tree import ChildTableTree
from drone_mesh.drone.location import Location
from drone_mesh.inprocess.clock import Clock

SHORTEST_PATH = "shortest_path"
JUST_IN_RANGE = 0.95  # of the range
RECOMPUTE_EVERY_S = 0.1  # period for recomputing links, which change when drones fly


class LinkMap:
    """The next hops of all shortest paths over the current links of a network."""

    def __init__(self, clock: Clock, links: Callable[[int], Iterable[int]]) -> None:
        """`links` returns the nodes that a node can send to now; links must be symmetric."""
        self._clock = clock
        self._links = links
        self._next_hops: dict[int, dict[int, int]] = {}  # by destination, by node
        self._computed_s = -RECOMPUTE_EVERY_S

    def neighbours(self, node: int) -> frozenset[int]:
        """The nodes that `node` can send to now."""
        return frozenset(self._links(node))

    def next_hop(self, node: int, destination: int) -> int:
        """The next hop of `node` on a shortest path, the lowest id of several, or NO_ROUTE."""
        now_s = self._clock.now_s
        if now_s - self._computed_s >= RECOMPUTE_EVERY_S:
            self._next_hops.clear()
            self._computed_s = now_s
        if destination not in self._next_hops:
            self._next_hops[destination] = self._paths_to(destination)
        return self._next_hops[destination].get(node, NO_ROUTE)

    def _paths_to(self, destination: int) -> dict[int, int]:
        hops = hops_from([destination], self._links)
        return {
            node: min(other for other in self._links(node) if hops.get(other) == away - 1)
            for node, away in hops.items()
            if away
        }


class ShortestPath(ChildTableTree):
    """Sends each packet to the next hop of a shortest path. It sees all links, without a packet."""

    TAKES_SHORTCUTS = False

    def __init__(self, links: LinkMap, node_id: int) -> None:
        super().__init__()
        self._links = links
        self._node_id = node_id

    def maintain_routing(self) -> None:
        """Introduce this node again, and check each neighbour with a heartbeat."""
        assert self._essentials is not None
        self._essentials.search_other_nodes_in_range()
        self._essentials.send_heartbeats(sorted(self.get_set_of_children()))

    def get_direction_to_node(self, node: int) -> int:
        return self._links.next_hop(self._node_id, node)

    def get_set_of_children(self) -> frozenset[int]:
        return self._links.neighbours(self._node_id)

    def empty(self) -> bool:
        return not self.get_set_of_children()

    def gateway_lost(self, gateway: int) -> bool:
        """Nothing to forget, and nothing to report to neighbours."""
        return False


class Oracle(IRepairStrategy):
    """A bound: flies into the range of the nearest connected node, which no real drone knows."""

    def __init__(self, connected: Callable[[], Mapping[int, Location]]) -> None:
        """`connected` returns the positions of all connected nodes."""
        self._connected = connected

    def on_emergency(self) -> None:
        """Fly, unless a drone in flight will become a relay."""
        mesh, here = self.mesh, self.mesh.own_place()
        self.reason = mesh.why_not_fly()
        places = self._connected()
        if self.reason or here is None or not places:
            return
        nearest = min(places, key=lambda node: (here.distance_m(places[node]), node))
        goal = places[nearest].towards(here, JUST_IN_RANGE * mesh.range_m)
        mesh.fly(Step(goal, nearest), until_connected=True)
