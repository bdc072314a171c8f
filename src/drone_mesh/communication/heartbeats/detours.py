"""Which neighbours a router avoids on its way to the gateway: silent ones, and those that swallow.

docs/security.md, "A relay that swallows". A captured relay can forward heartbeats, so that the
nodes behind it stay connected, and drop all other packets. With a key, only the gateway itself can
answer a request for its place. If it answers heartbeats but repeatedly does not answer this
request, a node on the route swallows packets.
"""

from __future__ import annotations

import logging
import math
from dataclasses import dataclass

from drone_mesh.communication.control.places import PlaceRequests
from drone_mesh.communication.interfaces import NO_ROUTE
from drone_mesh.communication.neighbours import Neighbours
from drone_mesh.communication.timing import Deadlines

AVOIDED_S = 60.0  # for a neighbour through which no answer came
SWALLOWER_AVOIDED_S = 600.0  # for a neighbour that seems to swallow packets


class Detours:
    """The neighbours that a router avoids on its way to the gateway, and the alternatives."""

    def __init__(self, neighbours: Neighbours) -> None:
        self._neighbours = neighbours
        self._until_s: dict[int, float] = {}  # by neighbour
        self._leaving_until_s: dict[int, float] = {}

    def avoid(self, neighbour: int, until_s: float) -> None:
        """Avoid this neighbour until then at least, because no answer came through it."""
        self._until_s[neighbour] = max(until_s, self._until_s.get(neighbour, -math.inf))

    def leaves(self, neighbour: int, until_s: float) -> None:
        """Avoid it until then, because it flies away, but still offers the way that it had."""
        self.avoid(neighbour, until_s)
        self._leaving_until_s[neighbour] = until_s

    def passes_by_leaving(self, neighbour: int, now_s: float) -> bool:
        """Whether it flies away and another neighbour has a gateway."""
        if now_s >= self._leaving_until_s.get(neighbour, -math.inf):
            return False
        return self.passes_by(neighbour, now_s)

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


ASK_PERIODS = 3.0  # in check periods: one packet and its answer in half a minute
WAIT_PERIODS = 0.9  # in check periods: a question that is younger may be answered yet
LEAST_UNANSWERED = 2  # for a next hop chosen because another one swallowed packets
LEAST_OF_QUEUED = 3  # where a loss says little: packets collide, and wait in queues of relays

_log = logging.getLogger(__name__)


class Swallowing:
    """Counts unanswered questions to one gateway."""

    def __init__(self, check_period_s: float, one_loss_counts: bool = True) -> None:
        """`one_loss_counts`: see Policy."""
        self._least = LEAST_UNANSWERED if one_loss_counts else LEAST_OF_QUEUED
        self._ask_period_s = ASK_PERIODS * check_period_s
        self._wait_s = WAIT_PERIODS * check_period_s
        self._answers = False  # whether this gateway knows its place and answers at all
        self._unanswered = 0
        self._may_be_lost = False  # the latest question, which counts as unanswered
        self._asked_s = -math.inf
        self._through = NO_ROUTE

    def through(self, next_hop: int, hops: int) -> None:
        """The next hop now: what was asked through another one says little about it."""
        if next_hop != self._through:
            self._through = next_hop
            self.another_next_hop(hops)

    def must_ask(self, now_s: float, patience: float) -> bool:
        """Whether to ask the gateway in this check: sooner after a question without answer.

        Checks follow each other faster while the surroundings change.
        """
        wait_s = self._answered_within_s(patience) if self._unanswered else self._ask_period_s
        return now_s - self._asked_s >= wait_s

    def _answered_within_s(self, patience: float) -> float:
        """On a busy channel heartbeats overtake questions, which wait in the queues of relays."""
        return self._wait_s * (1.0 + patience)

    def wants_heartbeat(self, hops: int) -> bool:
        """Whether to show the gateway the way back before the next question.

        It may have answered the latest one along a way that no longer leads here.
        """
        return self._unanswered > 0 and not self.noticed(hops)

    def is_over(self, now_s: float, heartbeat_s: float, patience: float) -> bool:
        """Whether the time for an answer is over and it has answered this node's heartbeat since.

        Its answers to nodes behind this one may come another way.
        """
        waited_s = now_s - self._asked_s
        return waited_s >= self._answered_within_s(patience) and heartbeat_s >= self._asked_s

    def asked(self, now_s: float) -> None:
        """The gateway was asked for its place."""
        self._asked_s = now_s
        self._unanswered += 1
        self._may_be_lost = True

    def not_taken(self) -> None:
        """The next hop did not take the latest question: it cannot have swallowed it.

        It counts once, although another neighbour may not take it, either.
        """
        if self._may_be_lost:
            self._may_be_lost = False
            self._unanswered = max(0, self._unanswered - 1)

    def answered(self) -> None:
        """The gateway answered a request for its place."""
        self._answers = True
        self._unanswered = 0

    def noticed(self, hops: int) -> bool:
        """Whether packets are swallowed on the route, which is `hops` long.

        Nodes with fewer hops come to this conclusion sooner. So the node next to the relay is the
        first to change its next hop, and the nodes behind it need not change theirs.
        """
        return self._answers and self._unanswered >= max(self._least, hops)

    def another_next_hop(self, hops: int) -> None:
        """The next hop has changed: suspect it after fewer unanswered requests than usual."""
        self._unanswered = min(self._unanswered, max(0, hops - self._least))

    def give_up(self) -> None:
        """Stop suspecting: there is another gateway, or it is silent through every next hop."""
        self._answers = False
        self._unanswered = 0


@dataclass(eq=False)
class RelayCheck:
    """The checks of one router. If packets are swallowed, it finds a detour for heartbeats."""

    _node_id: int
    _is_needed: bool  # the mesh has a key, and its technique takes shortcuts
    _check_period_s: float
    _one_loss_counts: bool
    _deadlines: Deadlines
    _requests: PlaceRequests
    _detours: Detours

    def __post_init__(self) -> None:
        self.swallowing = Swallowing(self._check_period_s, self._one_loss_counts)
        self._detour = NO_ROUTE

    def run(
        self, gateway: int, next_hop: int, hops: int, heartbeat_s: float, patience: float
    ) -> bool:
        """Check the route to `gateway`; returns whether the gateway was asked for its place.

        `heartbeat_s`: when it last answered a heartbeat of this node. If it answers only those,
        later ones go through another neighbour. `patience`: of the antenna, in check periods.
        """
        now_s = self._deadlines.now_s
        if not self._is_needed or next_hop in (gateway, NO_ROUTE):
            return False
        self.swallowing.through(next_hop, hops)
        if self.swallowing.noticed(hops) and self.swallowing.is_over(now_s, heartbeat_s, patience):
            self._detours.avoid(next_hop, now_s + SWALLOWER_AVOIDED_S)
            _log.warning(
                "node %d: gateway %d answers heartbeats through node %d, but no other packets",
                self._node_id,
                gateway,
                next_hop,
            )
        if self._detours.avoids(next_hop, now_s):  # just now, or the route has returned to it
            self._detour = self._detours.nearest(next_hop, hops, now_s)
            if self._detour == NO_ROUTE:
                self.swallowing.give_up()
                self._detours.avoid_none()
            else:
                self.swallowing.another_next_hop(hops)
            return False
        if not self.swallowing.must_ask(now_s, patience):
            return False
        self.swallowing.asked(now_s)
        if not self._requests.ask(gateway):
            self.swallowing.not_taken()
        return True

    def take_detour(self) -> int:
        """The neighbour to send the next heartbeat through, for one heartbeat; NO_ROUTE: none."""
        detour, self._detour = self._detour, NO_ROUTE
        return detour
