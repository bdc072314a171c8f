"""Delivery: sends packets to neighbours, remembers which passed, and informs them of lost nodes.

ImmediateDelivery is the way of the document; for a shared channel see queued_delivery.

docs/protocol.md, "Sending", "Circulating packets" and "Missing nodes".
"""

from __future__ import annotations

import abc
import math
from collections import deque
from dataclasses import dataclass
from typing import Hashable, Protocol, Sequence, Tuple

from drone_mesh.communication.control.delivery import IDelivery
from drone_mesh.communication.events.observer import MeshEventKind, Reporter
from drone_mesh.communication.interfaces import (
    NO_ROUTE,
    IMeshSeals,
    IWirelessCommunication,
)
from drone_mesh.communication.neighbours import Neighbours
from drone_mesh.communication.routing.interfaces import IRoutingTechnique
from drone_mesh.communication.timing import CIRCULATION_S, REPEATS, Deadlines, RateLimit, Strangers
from drone_mesh.communication.wire import messages
from drone_mesh.communication.wire.messages import CREATOR_AT, FORWARD_AT, TO_AT

DATA_PERSISTENCE = 3  # users' packets are many, so a chain of losses is more likely
LEAST_LOOP = 3  # links: no node sends a packet straight back to where it came from
MOST_TIMES = 3  # that one neighbour sends a packet: a lost acknowledgement makes it two
SENT_KEPT_S = 60.0  # on a channel that is too full a packet is under way for half a minute

Passage = Tuple[int, int, float, int, int]
"""Of a packet: the neighbour that it came from, its next hop, the time, its hop count, how often.

Of users' data the fourth is how often it took another way, and the last is counted on a shared
channel only: elsewhere its sender repeats it within milliseconds.
"""


class CirculationGuard:
    """Remembers for a while which packets passed through this node.

    A packet is identified by what does not change on its way: creator, type, final addressee and
    body.
    """

    def __init__(self, window_s: float = CIRCULATION_S) -> None:
        """`window_s`: how long it remembers."""
        self._window_s = window_s
        # Two tables used in turn, so that old passages are forgotten without a search for them.
        self._passages: dict[Hashable, Passage] = {}
        self._earlier: dict[Hashable, Passage] = {}
        self._turn_s = -math.inf  # when the earlier ones are forgotten

    def first_passage(self, identity: Hashable, now_s: float) -> Passage | None:
        """The packet's first passage, if it remembers one."""
        passage = self._passages.get(identity) or self._earlier.get(identity)
        return None if passage is None or now_s - passage[2] >= self._window_s else passage

    def passed(
        self,
        identity: Hashable,
        came_from: int,
        went_to: int,
        now_s: float,
        hops: int = 0,
        times: int = 1,
    ) -> None:
        """Record the first passage of a packet that was forwarded, or the latest one."""
        if now_s >= self._turn_s:
            self._turn_s = now_s + self._window_s
            self._passages, self._earlier = {}, self._passages
        self._passages[identity] = (came_from, went_to, now_s, hops, times)


def came_round(first: Passage, creator: int, came_from: int, hops: int | None = None) -> int | None:
    """The next hop of the packet's first passage, if it now comes round from another neighbour.

    What comes straight from its creator was sent again, and what comes from the same neighbour, up
    to MOST_TIMES. A heartbeat counts its hops: one with only a few more of them was sent again,
    too, another way.
    """
    first_from, went_to, _at_s, first_hops, times = first
    if came_from == creator or (came_from == first_from and times < MOST_TIMES):
        return None
    if hops is not None and hops < first_hops + LEAST_LOOP:
        return None
    return went_to


class IWayFinder(Protocol):
    """What the delivery tells and asks its control plane."""

    def on_neighbour_lost(self, node: int) -> None:
        """A neighbour did not take a packet; the routes are already updated."""

    def on_route_lost(self) -> None:
        """A route turned out to be wrong, and is removed."""

    def another_next_hop(self, node: int, but: int) -> int:
        """A neighbour to try for `node`, not `but`, beside those that the routes know."""

    def way_up(self, but: int) -> int:
        """See IControlPlane, also for the next one."""

    def seek(self, node: int) -> bool: ...


@dataclass(eq=False)
class Delivery(IDelivery):
    """Sends the packets of one node; the routes learn from success and failure.

    There are two ways, of which the medium decides: the outcome is known at once
    (`ImmediateDelivery`), or the antenna queues a packet and reports the outcome later
    (`QueuedDelivery`). Called only by the node's component and its parts.
    """

    _node_id: int
    _routing: IRoutingTechnique
    _ways: IWayFinder
    _antenna: IWirelessCommunication
    _neighbours: Neighbours
    _deadlines: Deadlines
    _attempts: int  # that fail: then the receiver counts as lost
    _report: Reporter
    _seals: IMeshSeals

    def __post_init__(self) -> None:
        self._strangers = Strangers()
        self._known = self._strangers.known  # read for each packet
        self._without_proof = self._seals.without_proof  # which is put on later than it is sent
        self._kept_s = self._antenna.medium.stretched(SENT_KEPT_S)
        self._relayed = CirculationGuard(self._kept_s)  # own packets
        self._begun_s = -math.inf  # what this node sent before its start comes back, too
        self.total_sent = 0

    # Sending ---------------------------------------------------------------------------------

    def send(self, payload: bytes, to: int, failures: int = 0, came_from: int = NO_ROUTE) -> bool:
        """Send a packet to neighbour `to`, with retransmissions. The routes learn from the outcome.

        `failures`: attempts that failed before this call; `came_from`: the neighbour to inform
        first if `to` turns out to be lost.
        """
        is_known = to in self._known
        if not is_known and self._strangers.ignores(to, self._deadlines.now_s):
            # Too many nodes that never took a packet were lost: drop this one, unannounced.
            self._neighbours.lost(to, self._deadlines.now_s)
            self._routing.cant_communicate_with_node(to)
            return False
        if payload[CREATOR_AT] == self._node_id and payload[FORWARD_AT] != to:
            now_s = self._deadlines.now_s
            identity = messages.identity(self._without_proof(payload))
            self._relayed.passed(identity, self._node_id, to, now_s)
        return self._transmit(payload, to, failures, came_from)

    @abc.abstractmethod
    def _transmit(self, payload: bytes, to: int, failures: int, came_from: int) -> bool:
        """Hand a packet to the antenna, as for `send`."""

    def begin(self) -> None:
        self._begun_s = self._deadlines.now_s

    def own_passage(self, payload: bytes) -> Passage | None:
        """When this node sent this packet, and to which relay; None: not within SENT_KEPT_S."""
        identity = messages.identity(self._without_proof(payload))
        return self._relayed.first_passage(identity, self._deadlines.now_s)

    def remembers_all(self) -> bool:
        """Whether it knows all packets of this node that may be under way."""
        return self._deadlines.now_s - self._begun_s > self._kept_s

    def delivered(self, to: int, tries: int) -> None:
        """The antenna has delivered a packet from a batch or from its queue."""
        self._known.add(to)
        self._routing.sent(to, True, tries)

    def send_own(self, payload: bytes) -> bool:
        """Send this node's own packet to its addressee, trying one route after the other."""
        other = messages.addressee(payload)
        tried: list[int] = []
        while True:
            directions = self._routing.directions(other, NO_ROUTE, self._node_id)
            if not directions and messages.is_data(payload):
                directions = [self._ways.way_up(NO_ROUTE)]
            untried = [to for to in directions if to != NO_ROUTE and to not in tried]
            if not untried:
                return False
            if self.send_to_each(payload, untried):
                return True
            tried += untried

    def send_to_each(self, payload: bytes, next_hops: Sequence[int]) -> bool:
        """Send the same packet to each of these neighbours. True: at least one received it."""
        taken = False
        for to in next_hops:
            packet = payload if payload[TO_AT] == to else messages.readdressed(payload, to)
            taken |= self.send(packet, to)
        return taken

    def send_own_to_each(self, payload: bytes, others: Sequence[int]) -> None:
        """Like `send_own`, to each of these."""
        for other in others:
            self.send_own(messages.addressed(payload, other))

    def undelivered(self, payload: bytes, tries: int) -> bool:
        """The antenna gave up a queued packet. Returns whether the packet takes another route."""
        return False

    # Lost nodes ------------------------------------------------------------------------------

    def forget_route(self, other: int, node: int, reported_by: int) -> None:
        """`other` cannot reach `node`; if no route is left, inform the other neighbours."""
        if other == node:
            self._neighbours.lost(node, self._deadlines.now_s)
        if self._routing.other_cant_communicate_with_node(other, node):
            self._report(MeshEventKind.NODE_MISSING, node)
            self.report_missing(node, reported_by=reported_by)

    def gateway_lost(self, gateway: int) -> None:
        """The routes to `gateway` do not work: forget them and inform the neighbours."""
        if self._routing.get_direction_to_node(gateway) == gateway:
            self._neighbours.lost(gateway, self._deadlines.now_s)
        if self._routing.gateway_lost(gateway):
            self.report_missing(gateway)

    def gateway_taken(self, neighbour: int, gateway: int) -> None:
        """Try `gateway` through `neighbour`, because other routes to it failed."""
        if self._routing.get_direction_to_node(gateway) == gateway:
            self._neighbours.lost(gateway, self._deadlines.now_s)
        self._routing.gateway_taken(neighbour, gateway)

    @abc.abstractmethod
    def report_missing(
        self, missing: int, first: int = NO_ROUTE, reported_by: int = NO_ROUTE
    ) -> None:
        """Tell the neighbours of a missing node, `first` before the others, not `reported_by`."""

    def came_back(self, missing: int, neighbour: int) -> None:
        """`neighbour` sent a packet for `missing` that this node could only send straight back."""
        self.report_missing(missing, first=neighbour)

    def neighbour_lost(self, node: int, came_from: int = NO_ROUTE) -> None:
        """A neighbour is out of reach, or about to be: find other routes.

        `came_from`: the neighbour to inform first.
        """
        self._strangers.gave_up(node, self._deadlines.now_s)
        if self._neighbours.lost(node, self._deadlines.now_s):
            self._report(MeshEventKind.NEIGHBOUR_LOST, node)
        if self._routing.cant_communicate_with_node(node):
            self._report(MeshEventKind.NODE_MISSING, node)
            self.report_missing(node, first=came_from)
        self._ways.on_neighbour_lost(node)


class ImmediateDelivery(Delivery):
    """Tries again at once; who takes no packet is lost, and each neighbour is told so."""

    def __post_init__(self) -> None:
        super().__post_init__()
        self._announced = RateLimit(REPEATS)
        self._missing_to_report: deque[tuple[int, int, int]] = deque()
        self._reporting = False

    def _transmit(self, payload: bytes, to: int, failures: int, came_from: int) -> bool:
        while failures < self._attempts or failures < self._most_attempts(payload):
            if self._antenna.send_message_to(payload):
                self.total_sent += 1
                self._known.add(to)
                self._routing.sent(to, True, failures + 1)
                return True
            failures += 1
        self._routing.sent(to, False, failures)
        if not messages.asks_for_place(payload):
            self.neighbour_lost(to, came_from)
        return False

    def _most_attempts(self, payload: bytes) -> int:
        return self._attempts * (DATA_PERSISTENCE if messages.is_data(payload) else 1)

    def send_own_to_each(self, payload: bytes, others: Sequence[int]) -> None:
        """Like `send_own`, to each of these; packets for direct neighbours leave together."""
        routing = self._routing
        direct = [other for other in others if routing.get_direction_to_node(other) == other]
        packets = [messages.addressed(payload, other) for other in direct]
        for other, packet, taken in zip(direct, packets, self._antenna.send_messages(packets)):
            if taken:
                self.total_sent += 1
                self.delivered(other, 1)
            elif not self.send(packet, other, failures=1):
                self.send_own(packet)
        if len(direct) < len(others):
            super().send_own_to_each(payload, list(set(others).difference(direct)))

    def report_missing(
        self, missing: int, first: int = NO_ROUTE, reported_by: int = NO_ROUTE
    ) -> None:
        """Send MISSING to every neighbour, to `first` before the others, not to `reported_by`.

        A neighbour that does not take the packet is itself lost. Its loss is queued, not handled
        within this call, so that the call depth does not grow with the number of neighbours.
        """
        if not self._announced.count(missing, self._deadlines.now_s):
            return
        self._missing_to_report.append((missing, first, reported_by))
        if self._reporting:
            return
        self._reporting = True
        me = self._node_id
        try:
            while self._missing_to_report:
                missing, first, reported_by = self._missing_to_report.popleft()
                packet = messages.MissingMessage(me, me, me, me, missing).to_payload()
                neighbours = self._routing.get_set_of_children() - {missing, reported_by}
                for neighbour in sorted(neighbours, key=lambda n: (n != first, n)):
                    if self._routing.get_direction_to_node(neighbour) == neighbour:
                        self.send_own(messages.addressed(packet, neighbour))
        finally:
            self._reporting = False
