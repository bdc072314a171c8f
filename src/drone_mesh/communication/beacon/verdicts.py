"""Verdicts: which neighbour takes a packet, or whether it waits for one."""

from __future__ import annotations

import itertools
import math
from typing import Iterator

from drone_mesh.communication.beacon.courier import DROP, HOLD, Transit
from drone_mesh.communication.beacon.routes import BeaconRoutes, Way
from drone_mesh.communication.beacon.search import HOPS_AROUND, MOST_HOPS, Searches
from drone_mesh.communication.interfaces import NO_ROUTE
from drone_mesh.communication.timing import Deadlines, Due
from drone_mesh.communication.wire import messages
from drone_mesh.communication.wire.packet_types import MessageType

HELD_S = 2.5  # a packet without a next hop waits this long
RETRY_S = 0.15  # so often it asks again, beside each beacon that arrives
MOST_WAYS = 3  # to which one node sends a packet down; after that it searches
SEARCHES_S = 0.6  # a relay without a way searches for so long, then returns a packet
SUSPECTED_S = 30.0  # an order is repeated within 16 s, a POLL within 30 s
NOT_HELD = (MessageType.MOVEMENT_NEGOTIATION, MessageType.FOUND)  # soon sent again


class Verdicts:
    """Decides about each packet that this node sends or forwards."""

    def __init__(self, routes: BeaconRoutes, searches: Searches, deadlines: Deadlines) -> None:
        self._routes, self._searches, self._deadlines = routes, searches, deadlines
        self.retry_s = -math.inf  # when held packets are looked at again
        # By node: the neighbours that took questions for it, and when.
        self._asked: dict[int, dict[int, float]] = {}

    def verdict_on(self, transit: Transit) -> int:
        """The next hop of a packet, HOLD or DROP."""
        routes = self._routes
        now_s = self._deadlines.now_s
        is_up = transit.addressee == routes.gateway
        ways = routes.next_hops(transit.addressee, transit.came_from)
        asks = _asks(transit)
        if asks:
            ways = self._answered_first(transit.addressee, ways)
        most = None if is_up or len(transit.sent_s) < MOST_WAYS else 1
        for to, shown_s in itertools.islice(ways, most):
            if to == transit.came_from or shown_s <= transit.sent_s.get(to, -math.inf):
                continue
            failed_s = transit.failed_s.get(to)
            if failed_s is None or routes.neighbours[to].alive_s > failed_s:
                if asks:
                    self._asked.setdefault(transit.addressee, {})[to] = now_s
                return to
        if now_s - transit.seen_s >= HELD_S or transit.kind in NOT_HELD:
            return DROP
        if not is_up:
            is_own = transit.came_from == NO_ROUTE
            if not is_own and now_s - transit.seen_s >= SEARCHES_S and self._may_return(transit):
                return transit.came_from
            self._searches.search(transit.addressee, MOST_HOPS if is_own else HOPS_AROUND)
        if self.retry_s <= now_s:
            self.retries()
        due_s = min(self.retry_s, self._deadlines.get(Due.ROUTING))
        self._deadlines.set(Due.ROUTING, due_s)
        return HOLD

    def retries(self) -> None:
        """All held packets ask again now."""
        self.retry_s = self._deadlines.now_s + RETRY_S

    def _answered_first(self, node: int, ways: Iterator[Way]) -> Iterator[Way]:
        """Last the neighbours that took questions since the node was heard: they may swallow."""
        routes = self._routes
        direct = routes.neighbours.get(node)
        heard_s = max(routes.led_s(node), -math.inf if direct is None else direct.heard_s)
        asked = self._asked[node] = {
            to: at_s
            for to, at_s in self._asked.get(node, {}).items()
            if at_s > max(heard_s, routes.now_s - SUSPECTED_S)
        }
        for to in asked:
            routes.in_vain(node, to)
        return iter(sorted(ways, key=lambda way: asked.get(way.neighbour, -math.inf)))

    def _may_return(self, transit: Transit) -> bool:
        """Whether the sender of a packet, who may know another way, can get it back."""
        to = transit.came_from
        return (
            to in self._routes.neighbours
            and to not in transit.sent_s
            and to not in transit.failed_s
        )


def _asks(transit: Transit) -> bool:
    """Whether this packet comes again while there is no answer."""
    if transit.kind == messages.QUESTION:
        return bool(transit.payload[messages.QUESTION_AT])
    return transit.kind == MessageType.MOVE_TO_LOCATION
