"""Searches: a flooded, bounded search for a node that no announcement leads to."""

from __future__ import annotations

import math
from typing import Callable

from drone_mesh.communication.beacon.packets import Search
from drone_mesh.communication.beacon.routes import BeaconRoutes
from drone_mesh.communication.wire.packet_types import MessageType

AGAIN_S = 0.6  # broadcasts are not acknowledged
MOST_HOPS = 12
HOPS_AROUND = 2  # of a search by a relay, which was near the node a moment ago
SAME_S = 5.0  # far longer than a search takes to pass through a mesh
MOST_IN_VAIN = 5  # searches in a row for a node
PAUSE_S = 10.0  # after them
GAP_HOPS = 400  # between two searches; each takes time on the air for every node

Broadcast = Callable[[int, int, bytes], None]


class Searches:
    """The searches of one node, and its part in those of others."""

    def __init__(
        self, node_id: int, routes: BeaconRoutes, broadcast: Broadcast, hop_s: float
    ) -> None:
        self._node_id = node_id
        self._routes = routes
        self._broadcast = broadcast
        self._gap_s = GAP_HOPS * hop_s
        self._free_s = -math.inf  # when the last search that was heard or sent is over
        self._number = 0
        self._searched: dict[int, tuple[float, int]] = {}  # by node: when, how often in vain
        self._seen_s: dict[tuple[int, int], float] = {}  # creator, number

    def search(self, node: int, hops: int) -> None:
        """Search for `node`, unless that was done a moment ago; `hops` times repeated at most."""
        now_s = self._routes.now_s
        at_s, in_vain = self._searched.get(node, (-math.inf, 0))
        if now_s - at_s >= PAUSE_S:
            in_vain = 0
        if now_s - at_s < AGAIN_S or in_vain >= MOST_IN_VAIN or now_s < self._free_s:
            return
        self._free_s = now_s + self._gap_s
        self._searched[node] = now_s, in_vain + 1
        self._number = (self._number + 1) % 2**16
        search = Search(node, self._number, hops)
        self._broadcast(MessageType.SEARCH, self._node_id, search.to_body())

    def found(self, node: int) -> None:
        """A search for `node` was not in vain."""
        self._searched.pop(node, None)

    def heard(self, creator: int, from_: int, body: bytes) -> bool:
        """A search of another node; returns whether this node answers. Repeats it otherwise."""
        search, now_s = Search.from_body(body), self._routes.now_s
        key = creator, search.number
        if creator == self._node_id or now_s - self._seen_s.get(key, -math.inf) < SAME_S:
            return False
        for old in [seen for seen, at_s in self._seen_s.items() if now_s - at_s >= SAME_S]:
            del self._seen_s[old]
        self._seen_s[key] = now_s
        self._free_s = now_s + self._gap_s
        self._routes.led_to(creator, from_)
        if search.node == self._node_id:
            return True
        if search.hops_left > 0:
            repeated = search._replace(hops_left=min(search.hops_left, MOST_HOPS) - 1)
            self._broadcast(MessageType.SEARCH, creator, repeated.to_body())
        return False
