"""Which neighbour takes a packet, whether it waits for one, and the searches for one."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from typing import Callable, Final, Iterator

from drone_mesh.communication.beacon.courier import DROP, HOLD, Transit
from drone_mesh.communication.beacon.packets import Search
from drone_mesh.communication.beacon.routes import BeaconRoutes, Way
from drone_mesh.communication.interfaces import NO_ROUTE
from drone_mesh.communication.timing import Deadlines, Due
from drone_mesh.communication.wire import messages
from drone_mesh.communication.wire.packet_types import MessageType

AGAIN_S: Final = 0.6  # broadcasts are not acknowledged
MOST_HOPS: Final = 12
HOPS_AROUND: Final = 2  # of a search by a relay, which was near the node a moment ago
SAME_S: Final = 5.0  # far longer than a search takes to pass through a mesh
MOST_IN_VAIN: Final = 5  # searches in a row for a node
PAUSE_S: Final = 10.0  # after them
GAP_HOPS: Final = 400  # between two searches; each takes time on the air for every node

Broadcast = Callable[[int, int, bytes], None]


@dataclass(eq=False)
class Searches:
    """The searches of one node, and its part in those of others."""

    _node_id: int
    _routes: BeaconRoutes
    _broadcast: Broadcast
    _hop_s: float

    def __post_init__(self) -> None:
        self._gap_s = GAP_HOPS * self._hop_s
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


HELD_S: Final = 2.5  # a packet without a next hop waits this long
RETRY_S: Final = 0.15  # so often it asks again, beside each beacon that arrives
MOST_WAYS: Final = 3  # to which one node sends a packet down; after that it searches
SEARCHES_S: Final = 0.6  # a relay without a way searches for so long, then returns a packet
BURST_S: Final = 0.4  # longer than a burst of collisions, which takes all tries of a packet
SUSPECTED_S: Final = 30.0  # an order is repeated within 16 s, a POLL within 30 s
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
        if asks or (is_up and self._asked.get(transit.addressee)):
            ways = self._answered_first(transit.addressee, ways, asks)
        most = None if is_up or len(transit.sent_s) < MOST_WAYS else 1
        again_s = math.inf  # when a neighbour that did not take it may have it once more
        for to, shown_s in itertools.islice(ways, most):
            if to == transit.came_from or shown_s <= transit.sent_s.get(to, -math.inf):
                continue
            at_s = self._may_have_it_s(transit, to)
            if at_s <= now_s:
                if to in transit.failed_s:
                    transit.again.add(to)
                if asks and to != transit.addressee:
                    self._asked.setdefault(transit.addressee, {})[to] = now_s
                return to
            again_s = min(again_s, at_s)
        if now_s - transit.seen_s >= HELD_S or transit.kind in NOT_HELD:
            return DROP
        if not is_up:
            back, is_own = transit.came_from, transit.came_from == NO_ROUTE
            knows_back = back in routes.neighbours  # who may know another way
            is_tried = back in transit.sent_s or back in transit.failed_s
            is_time = now_s - transit.seen_s >= SEARCHES_S and again_s == math.inf
            if is_time and knows_back and not is_tried:
                return back
            self._searches.search(transit.addressee, MOST_HOPS if is_own else HOPS_AROUND)
        if self.retry_s <= now_s:
            self.retries()
        due_s = min(self.retry_s, self._deadlines.at_s[Due.ROUTING])
        self._deadlines.set(Due.ROUTING, due_s)
        return HOLD

    def _may_have_it_s(self, transit: Transit, to: int) -> float:
        """When a neighbour may have a packet: after it did not take it, once more or never.

        Once more only users' messages: the others are sent again by their creators, and at the
        start of a mesh they would fill the channel.
        """
        failed_s, neighbour = transit.failed_s.get(to), self._routes.neighbours[to]
        if failed_s is None or neighbour.alive_s > failed_s:
            return -math.inf
        is_once_more = messages.is_data(transit.payload) and to not in transit.again
        if self._routes.one_loss_counts or not neighbour.usable or not is_once_more:
            return math.inf
        return failed_s + BURST_S

    def retries(self) -> None:
        """All held packets ask again now."""
        self.retry_s = self._deadlines.now_s + RETRY_S

    def hears(self, node: int, through: int) -> None:
        """Call before `BeaconRoutes.led_to`: this packet may answer a question to the gateway.

        It clears the neighbour that it came through, or, if it came another way back, the one that
        took the question.
        """
        asked = self._asked.get(node)
        if not asked or node != self._routes.gateway:
            return
        last = through if through in asked else max(asked, key=asked.__getitem__)
        if last == through or asked[last] > self._routes.led_s(node):
            del asked[last]

    def _answered_first(self, node: int, ways: Iterator[Way], asks: bool) -> Iterator[Way]:
        """Last the neighbours that took questions since the node was heard: they may swallow.

        Packets down follow what was heard. Those up would go to the parent that swallows again, so
        that the gateway was heard clears only the neighbour whose question it has answered.
        """
        routes = self._routes
        direct = routes.neighbours.get(node)
        heard_s = -math.inf if node == routes.gateway else routes.led_s(node)
        if direct is not None:
            heard_s = max(heard_s, direct.heard_s)
        asked = self._asked[node] = {
            to: at_s
            for to, at_s in self._asked.get(node, {}).items()
            if at_s > max(heard_s, routes.now_s - SUSPECTED_S)
        }
        for to in asked:
            routes.in_vain(node, to)
        # An answer that is on its way is no reason for other packets to take a longer one.
        before_s = math.inf if asks else routes.led_s(node)
        late = {to: at_s for to, at_s in asked.items() if at_s < before_s}
        return iter(sorted(ways, key=lambda way: late.get(way.neighbour, -math.inf)))


def _asks(transit: Transit) -> bool:
    """Whether this packet comes again while there is no answer."""
    if transit.kind == messages.QUESTION:
        return bool(transit.payload[messages.QUESTION_AT])
    return transit.kind == MessageType.MOVE_TO_LOCATION
