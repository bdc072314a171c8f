"""Swallowing: notices that the route to the gateway carries heartbeats and nothing else.

docs/security.md, "A relay that swallows". A captured relay can forward heartbeats, so that the
nodes behind it stay connected, and drop all other packets. With a key, only the gateway itself can
answer a request for its place. If it answers heartbeats but repeatedly does not answer this
request, a node on the route swallows packets.
"""

from __future__ import annotations

import math

from drone_mesh.communication.interfaces import NO_ROUTE
from drone_mesh.communication.neighbours import Neighbours

ASK_PERIODS = 3.0  # our choice, in check periods: one packet and its answer in half a minute
LEAST_UNANSWERED = 2  # our choice: for a next hop chosen because another one swallowed packets


class Swallowing:
    """Counts unanswered questions to one gateway."""

    def __init__(self, check_period_s: float) -> None:
        self._ask_period_s = ASK_PERIODS * check_period_s
        self._answers = False  # whether this gateway knows its place and answers at all
        self._unanswered = 0
        self._asked_s = -math.inf

    def must_ask(self, now_s: float) -> bool:
        """Whether to ask the gateway in this check: in each one after a question without answer."""
        return self._unanswered > 0 or now_s - self._asked_s >= self._ask_period_s

    def asked(self, now_s: float) -> None:
        """The gateway was asked for its place."""
        self._asked_s = now_s
        self._unanswered += 1

    def answered(self) -> None:
        """It answered."""
        self._answers = True
        self._unanswered = 0

    def noticed(self, hops: int) -> bool:
        """Whether packets are swallowed on the route, which is `hops` long.

        Nodes with fewer hops come to this conclusion sooner. So the node next to the relay is the
        first to change its next hop, and the nodes behind it need not change theirs.
        """
        return self._answers and self._unanswered >= max(LEAST_UNANSWERED, hops)

    def another_next_hop(self, hops: int) -> None:
        """The route has changed, and must soon prove that it works."""
        self._unanswered = max(0, hops - LEAST_UNANSWERED)

    def give_up(self) -> None:
        """Stop suspecting: there is another gateway, or it is silent over every next hop."""
        self._answers = False
        self._unanswered = 0


class Detours:
    """The neighbours that a router avoids on its way to the gateway, and the alternatives."""

    def __init__(self, neighbours: Neighbours) -> None:
        self._neighbours = neighbours
        self._until_s: dict[int, float] = {}  # by neighbour

    def avoid(self, neighbour: int, until_s: float) -> None:
        """Avoid this neighbour until then, because no answer came through it."""
        self._until_s[neighbour] = until_s

    def avoid_none(self) -> None:
        """Forget all: none is better than the others."""
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
