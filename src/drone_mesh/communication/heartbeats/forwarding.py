"""Forwarding: packets that are addressed to other nodes (docs/protocol.md, "Forwarding")."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Hashable, Sequence

from drone_mesh.communication.events.complaints import Complaints
from drone_mesh.communication.events.observer import MeshEventKind, Reporter
from drone_mesh.communication.heartbeats.delivery import (
    CirculationGuard,
    Delivery,
    IWayFinder,
    Passage,
    came_round,
)
from drone_mesh.communication.interfaces import NO_ROUTE
from drone_mesh.communication.routing.interfaces import IRoutingTechnique
from drone_mesh.communication.timing import CIRCULATION_S, Medium, RateLimit
from drone_mesh.communication.wire import messages
from drone_mesh.communication.wire.packet_types import MessageType

_HEARTBEAT = int(MessageType.HEARTBEAT)
_BID = int(MessageType.MOVEMENT_NEGOTIATION)
CREATORS_TOLD = 8  # MISSING to one creator of users' data, per limits.LIMIT_PERIOD_S
MOST_TURNS = 3  # of one packet of users' data in one node, on which it comes back
MOST_HELD = 64  # packets that wait in a gateway for the end of a search
HELD_S = 4.0  # a search passes through 100 nodes within half a second; its answer may get lost


@dataclass(eq=False)
class Forwarding:
    """Sends packets of other nodes to their next hop. Called only by the node's component."""

    _node_id: int
    _routing: IRoutingTechnique
    _ways: IWayFinder
    _delivery: Delivery
    _medium: Medium
    _complaints: Complaints
    _report: Reporter

    def __post_init__(self) -> None:
        self._floods = self._routing.FLOODS
        self._told = RateLimit(CREATORS_TOLD)
        self._circulates_s = self._medium.stretched(CIRCULATION_S)
        self._circulation = CirculationGuard(self._circulates_s)
        self._counts = self._medium.policy.queued
        self._held: list[tuple[float, bytes]] = []  # until when, packet: the oldest first
        self._held_s = self._medium.stretched(HELD_S)

    def forward(
        self, payload: bytes, creator: int, from_: int, kind: int, forward: int, now_s: float
    ) -> None:
        """Forward a packet to its addressee; drop it if it circulates or has no route.

        `creator`, `from_`, `kind` and `forward` are those of its header.
        """
        routing = self._routing
        if self._floods:
            if creator == self._node_id:
                return
            self._flood(payload, routing.directions(forward, from_, creator), now_s)
            return
        if creator == self._node_id:
            self._own_came_back(payload, from_, now_s)
            return
        identity: Hashable
        hops: int | None
        if kind == _HEARTBEAT:  # most packets; these four values are cheaper than their bytes
            know_gateway, gateway, hops = messages.heartbeat_body(payload)
            identity = (creator, forward, know_gateway, gateway)
        else:
            identity, hops = messages.identity(payload), None
        first = self._circulation.first_passage(identity, now_s)
        if first is not None:
            went_to = came_round(first, creator, from_, hops)
            if went_to is not None:
                if not self._another_way(payload, first, from_, now_s):
                    self._drop_circulating(payload, went_to, now_s)
                return
        lost = NO_ROUTE
        for _attempt in (1, 2):
            directions = routing.directions(forward, from_, creator)
            to = directions[0] if directions else NO_ROUTE
            if to in (NO_ROUTE, from_) and messages.is_data(payload):
                hop = self._hop_of_data(forward, from_, creator, is_listed=to == from_)
                if hop != NO_ROUTE:
                    to = hop
                elif self._seeks(payload, now_s):
                    return
                elif first is None:  # who took this node for the way learns that it is none
                    self._pass_on(payload, from_, from_, now_s)
                    return
            if to in (NO_ROUTE, from_):
                self.stranded(payload)
                if to == from_:
                    self._delivery.came_back(forward, from_)
                elif lost != forward:  # otherwise the neighbours know already
                    self._delivery.report_missing(forward, first=from_)
                return
            forwarded = messages.next_hop(payload, self._node_id, to)
            if forwarded is None:
                self._complaints.dropped("a heartbeat with too many hops", payload, now_s)
                return
            if self._delivery.send(forwarded, to, 0, from_):  # keywords cost more
                if first is None:
                    self._circulation.passed(identity, from_, to, now_s, hops or 0)
                elif self._counts and messages.is_data(payload):
                    came_from, _to, _at_s, turns, times = first
                    self._circulation.passed(identity, came_from, to, now_s, turns, times + 1)
                return
            lost = to
        self.stranded(payload)

    def _hop_of_data(self, forward: int, from_: int, creator: int, is_listed: bool) -> int:
        """The next hop of users' data for a node without a route; NO_ROUTE: none, or back.

        `is_listed`: it counted as behind `from_`, which would then not have sent this packet here.
        """
        if is_listed and from_ != forward:
            self._routing.other_cant_communicate_with_node(from_, forward)
            self._ways.on_route_lost()
            directions = self._routing.directions(forward, from_, creator)
            if directions and directions[0] != from_:
                return directions[0]
        up = self._ways.way_up(NO_ROUTE)
        return NO_ROUTE if up == from_ else up

    def _another_way(self, payload: bytes, first: Passage | None, from_: int, now_s: float) -> bool:
        """Users' data has come back from `from_`: the way that it took is wrong.

        It takes another one. Without one it goes back: to that neighbour, if it took this node for
        the way, else to the one that it first came from. So each node on a wrong way learns that,
        as in a depth-first search. False: it ends here.
        """
        if first is None or not messages.is_data(payload) or first[3] >= MOST_TURNS:
            return False
        creator, _from, _kind, _to, forward = messages.header(payload)
        came_from, went_to, _at_s, turns, _times = first
        self._is_wrong(forward, went_to)
        directions = self._routing.directions(forward, came_from, creator)
        to = directions[0] if directions else NO_ROUTE
        if to in (NO_ROUTE, came_from, from_, went_to):
            to = self._hop_of_data(forward, came_from, creator, is_listed=to == came_from)
        if to in (NO_ROUTE, came_from, from_, went_to):
            if self._seeks(payload, now_s):
                return True
            if from_ not in (came_from, went_to) and went_to != came_from:
                return self._pass_on(payload, came_from, from_, now_s, turns + 1, went_to)
            to = came_from
        return to != self._node_id and self._pass_on(payload, came_from, to, now_s, turns + 1)

    def _pass_on(
        self,
        payload: bytes,
        came_from: int,
        to: int,
        now_s: float,
        turns: int = 0,
        went_to: int | None = None,
    ) -> bool:
        """Send users' data to a neighbour. False: it did not take it.

        `went_to`: the next hop that it already took, if `to` only gets it back.
        """
        forwarded = messages.next_hop(payload, self._node_id, to)
        if forwarded is None or not self._delivery.send(forwarded, to, 0, came_from):
            return False
        used = to if went_to is None else went_to
        self._circulation.passed(messages.identity(payload), came_from, used, now_s, turns)
        return True

    def _seeks(self, payload: bytes, now_s: float) -> bool:
        """A gateway searches for the addressee of users' data; the packet waits for the answer."""
        creator, _from, _kind, _to, forward = messages.header(payload)
        if not self._ways.seek(forward):
            return False
        self._held = [held for held in self._held if held[0] > now_s][1 - MOST_HELD :]
        self._held.append((now_s + self._held_s, payload))
        if self._told.count(creator, now_s):
            self._send_missing(creator, forward)
        return True

    def found(self, node: int, now_s: float) -> None:
        """There is a route to a node: send on what waits for it."""
        if not self._held:
            return
        waiting = [held for held in self._held if messages.addressee(held[1]) == node]
        self._held = [held for held in self._held if held not in waiting]
        for until_s, payload in waiting:
            to = self._routing.get_direction_to_node(node)
            if now_s < until_s and to != NO_ROUTE:
                self._pass_on(payload, messages.sender(payload), to, now_s)

    def _own_came_back(self, payload: bytes, from_: int, now_s: float) -> None:
        """A packet of this node came back: users' data takes another way; if sent just now, a loop.

        A bid may be one that a neighbour passes on in this node's name, perhaps through it.
        """
        sent = self._delivery.own_passage(payload)
        if sent is not None:
            _from, went_to, sent_s, _hops, _times = sent
            own = self._circulation.first_passage(messages.identity(payload), now_s)
            first = own or (self._node_id, went_to, sent_s, 0, 1)
            if self._another_way(payload, first, from_, now_s):
                return
            if now_s - sent_s < self._circulates_s:
                self._drop_circulating(payload, went_to, now_s)
        elif self._delivery.remembers_all() and payload[messages.TYPE_AT] != _BID:
            reason = "a packet in this node's name that it did not send"
            self._complaints.dropped(reason, payload, now_s)

    def _flood(self, payload: bytes, next_hops: Sequence[int], now_s: float) -> None:
        forwarded = messages.next_hop(payload, self._node_id, self._node_id)
        if forwarded is None:
            self._complaints.dropped("a heartbeat with too many hops", payload, now_s)
        else:
            self._delivery.send_to_each(forwarded, next_hops)

    def _drop_circulating(self, payload: bytes, used: int, now_s: float) -> None:
        forward = messages.addressee(payload)
        # No line: while drones fly, loops come and go.
        self._complaints.counts["dropped a packet that circulates"] += 1
        self._is_wrong(forward, used)
        self.stranded(payload)

    def _is_wrong(self, node: int, used: int) -> None:
        """A packet for `node` that went to `used` came back; that may have been the only way up."""
        self._routing.circulated(node, used)
        self._ways.on_route_lost()

    def not_taken(self, payload: bytes, now_s: float) -> None:
        """The next hop did not take a queued packet, and there is no detour."""
        first = self._circulation.first_passage(messages.identity(payload), now_s)
        if not self._another_way(payload, first, messages.receiver(payload), now_s):
            self.stranded(payload)

    def stranded(self, payload: bytes) -> None:
        """A packet has no next hop. Report an order, also to the gateway that sent it."""
        creator, _from, kind, _to, forward = messages.header(payload)
        if kind != MessageType.MOVE_TO_LOCATION:
            return
        self._complaints.counts[f"no route to drone {forward}"] += 1  # its gateway looks for it
        self._report(MeshEventKind.NO_ROUTE, forward)
        self._send_missing(creator, forward)

    def _send_missing(self, to: int, missing: int) -> None:
        me = self._node_id
        if to != me:
            packet = messages.MissingMessage(me, me, to, to, missing)
            self._delivery.send_own(packet.to_payload())
