"""HeartbeatPlane: a router's control plane by heartbeats (docs/protocol.md, "Connection")."""

from __future__ import annotations

import math
from typing import Sequence

from drone_mesh.communication.control.control_plane import ControlledNode, IControlPlane
from drone_mesh.communication.control.node_part import due, receives
from drone_mesh.communication.control.places import PlaceRequests
from drone_mesh.communication.control.router_states import (
    ConnectionState,
    RepairState,
    RouterEvent,
    RouterStates,
)
from drone_mesh.communication.heartbeats.connection import GatewayConnection
from drone_mesh.communication.heartbeats.delivery import Delivery, ImmediateDelivery
from drone_mesh.communication.heartbeats.forwarding import Forwarding
from drone_mesh.communication.heartbeats.introduction import Introduction
from drone_mesh.communication.heartbeats.node_search import NodeSearch
from drone_mesh.communication.heartbeats.queued_delivery import QueuedDelivery
from drone_mesh.communication.interfaces import BROADCAST, MAX_NODE_ID, NO_ROUTE
from drone_mesh.communication.neighbours import Neighbours
from drone_mesh.communication.routing.interfaces import IRoutingEssentials, IRoutingTechnique
from drone_mesh.communication.timing import Due, Medium
from drone_mesh.communication.wire import messages
from drone_mesh.communication.wire.packet_types import ABOUT, Handler, MessageType
from drone_mesh.drone.location import Location

_HEARTBEAT = int(MessageType.HEARTBEAT)
_OF_TECHNIQUES = [number for number in range(256) if ABOUT[number].handler is Handler.TECHNIQUE]
CHANGE_PERIODS = 0.3  # until the check after a neighbour was lost, on average


class HeartbeatPlane(IControlPlane, IRoutingEssentials):
    """Neighbours, connection and routes by PRESENT, HEARTBEAT and MISSING.

    A router keeps a connection to a gateway by heartbeats that it answers.
    """

    def __init__(
        self, node: ControlledNode, technique: IRoutingTechnique, states: RouterStates
    ) -> None:
        self._node_id = node.node_id
        self._host = node.host
        self._states = states
        self._technique = self.routes = technique
        self._antenna, self._medium = node.antenna, node.antenna.medium
        self._check_period_s = self.bids_within_s = node.timing.check_period_s
        self._deadlines = node.deadlines
        neighbours = Neighbours(self._medium, self._check_period_s, node.range_m)
        self.neighbours = self._neighbours = neighbours
        self._places = node.places
        self._pilot = node.pilot
        self._may_be_gateway = node.seals.may_be_gateway
        self._rng = node.rng
        self._is_passing = False  # this node flies far by order
        medium, policy = self._medium, self._medium.policy
        deliver = QueuedDelivery if policy.queued else ImmediateDelivery
        self._delivery: Delivery = deliver(
            node.node_id,
            technique,
            self,
            node.antenna,
            neighbours,
            node.deadlines,
            node.timing.send_attempts,
            node.report,
            node.seals,
        )
        self.delivery = self._delivery
        self._forwarding = Forwarding(
            self._node_id, technique, self, self._delivery, medium, node.complaints, node.report
        )
        self._introduction = Introduction(
            node.node_id,
            self,
            technique,
            node.antenna,
            node.seals,
            node.deadlines,
            self._check_period_s,
            node.frame,
            node.rng,
        )
        self._search = NodeSearch(
            node.node_id, node.antenna, node.deadlines, node.complaints, self._answer_search
        )
        self._connection = self._connected_by(node, GatewayConnection)
        self.learn = self._learn
        learns = policy.answers_prove_relays
        self.forward = self._forward_and_learn if learns else self._forwarding.forward

    def _connected_by(
        self, node: ControlledNode, kind: type[GatewayConnection]
    ) -> GatewayConnection:
        return kind(
            node.node_id,
            self._states,
            self._technique,
            self._delivery,
            self._introduction,
            PlaceRequests(node.node_id, node.pilot, node.antenna, self._delivery, node.deadlines),
            self._medium,
            node.deadlines,
            self._check_period_s,
            self._neighbours,
            node.places,
            node.report,
            node.seals.has_key,
            node.antenna.patience,
            node.rng,
        )

    @property
    def parts(self) -> Sequence[object]:
        return self, self._introduction, self._search

    # Time and surroundings -------------------------------------------------------------------

    def start(self) -> None:
        self._delivery.begin()
        self._technique.start_routing(self)

    def check(self, due_s: float) -> None:
        """Check neighbours, routes and gateway."""
        if not self._host.may_connect(NO_ROUTE, False):
            return
        before = self._states.connection  # the routing may send a heartbeat to the gateway
        was_connected = self._states.connected
        self._technique.maintain_routing()
        if was_connected:
            self._connection.check()
        elif self._connection.just_lost or before is not ConnectionState.SEARCHING:
            pass  # a repair counts from the next check, or a heartbeat is under way
        elif self._connection.asks_gateway_that_resigned():
            pass  # it is in reach: a flight would repair nothing
        elif self._states.repair is not RepairState.FLYING:
            self._host.on_unconnected_check(due_s)
        self._connection.just_lost = False

    @due(Due.ANSWER)
    def on_answer_missed(self) -> None:
        self._connection.answer_missed()

    @due(Due.ROUTING)
    def on_technique_due(self) -> None:
        self._deadlines.set(Due.ROUTING, math.inf)
        self._technique.on_time(self._deadlines.now_s)

    def on_power(self, on: bool) -> None:
        self._introduction.on_power(on)

    def on_registered(self) -> None:
        if self._antenna.on():
            self._introduction.on_registered()

    def introduce(self) -> None:
        self._introduction.broadcast()

    def flies_far(self) -> None:
        """Be no shorter way for others: where a lost link is noticed late, it is soon none."""
        self._is_passing = True

    def neighbour_leaves(self, neighbour: int) -> None:
        """Look for other routes while the old ones still work."""
        self._connection.neighbour_leaves(neighbour)
        self._delivery.neighbour_lost(neighbour)

    # The connection --------------------------------------------------------------------------

    @property
    def gateway(self) -> int:
        return self._connection.gateway

    @property
    def hops(self) -> int:
        return self._connection.hops

    @property
    def offered_hops(self) -> int:
        """What neighbours are told; NO_ROUTE: this node is a way only for those without one."""
        return NO_ROUTE if self._is_passing else self.hops

    @property
    def connected(self) -> bool:
        return self._connection.connected

    def next_hop(self) -> int:
        return self._connection.next_hop()

    def told_of_gateway(self, gateway: int) -> bool:
        return self._connection.told_of_gateway(gateway)

    def end(self, event: RouterEvent) -> None:
        if event is RouterEvent.LANDED:
            self._is_passing = False
        self._connection.end(event)

    def give_up_routes(self) -> None:
        if self.gateway != NO_ROUTE:
            self._delivery.gateway_lost(self.gateway)

    def leave(self) -> None:
        self.give_up_routes()
        self.end(RouterEvent.ROUTE_LOST)

    def gateway_sent_place(self) -> None:
        self._connection.swallowing.answered()

    # Packets ---------------------------------------------------------------------------------

    @receives(MessageType.PRESENT)
    def on_present(self, payload: bytes, creator: int, _from: int) -> None:
        hops, know_gateway = messages.present_body(payload)
        self._neighbours.set_hops(creator, hops)
        if know_gateway and hops == 0:
            self._neighbours.set_gateway(creator, creator)
        if not self._host.may_connect(creator, know_gateway):
            return
        if self._connection.on_present(creator, hops, know_gateway):
            if know_gateway:
                self.send_heartbeat(creator)
            else:
                self._introduction.answer_search(creator)

    @receives(MessageType.HEARTBEAT)
    def on_heartbeat(self, payload: bytes, creator: int, from_: int) -> None:
        if creator == self._node_id:
            return  # its own heartbeat came back, which proves nothing
        know_gateway, preferred_gateway, hops = messages.heartbeat_body(payload)
        if creator == from_ and know_gateway and preferred_gateway <= MAX_NODE_ID:
            self._neighbours.set_gateway(creator, preferred_gateway)
        if not self._host.may_connect(from_, know_gateway):
            return
        if creator == self.gateway != preferred_gateway:
            self._connection.gateway_resigned()
        if creator == preferred_gateway:
            if creator == self.gateway:
                self._connection.answered_itself()
            if self._connection.on_gateway_heartbeat(creator, hops + 1):
                self._host.on_connected()
        elif know_gateway != self._states.connected:
            if not know_gateway:
                self.send_heartbeat(creator)
            elif not self._states.awaiting:
                self._connection.take_gateway_of(from_, preferred_gateway)

    def _learn(self, creator: int, from_: int, kind: int, payload: bytes) -> bool:
        """A neighbour that flies away teaches no way: an answer through it may be a late one."""
        if creator != from_ and self._connection.passes_by_leaving(from_):
            return kind != _HEARTBEAT
        return self._technique.learn(creator, from_, kind, payload)

    def _forward_and_learn(
        self, payload: bytes, creator: int, from_: int, kind: int, forward: int, now_s: float
    ) -> None:
        """On a shared channel a gateway's answer proves the connection of each relay as well."""
        if kind == _HEARTBEAT:
            know_gateway, preferred_gateway, hops = messages.heartbeat_body(payload)
            proves = creator == preferred_gateway and self._host.may_connect(NO_ROUTE, know_gateway)
            proves = proves and self._may_be_gateway(creator)
            if proves and self._connection.on_gateway_heartbeat(creator, hops + 1):
                self._host.on_connected()
        self._forwarding.forward(payload, creator, from_, kind, forward, now_s)

    @receives(MessageType.MISSING)
    def on_missing(self, payload: bytes, creator: int, from_: int) -> None:
        """`creator` reports that it cannot reach a node."""
        missing = messages.MissingMessage.from_payload(payload).missing
        if missing != self._node_id:
            if missing == self.gateway:
                self._neighbours.set_hops(creator, NO_ROUTE)
            self._delivery.forget_route(creator, missing, from_)
            self._connection.on_route_lost()
            told_alone = messages.addressee(payload) != BROADCAST
            self._host.on_node_missing(missing, told_alone)
            if missing == self._connection.next_hop():
                self._connection.doubt_next_hop()

    @receives(*_OF_TECHNIQUES)
    def on_packet_of_technique(self, payload: bytes, creator: int, from_: int) -> None:
        kind = messages.type_of(payload)
        self._technique.on_packet(creator, from_, kind, messages.body(payload))

    def own_came_back(self, from_: int) -> None:
        """Learn only that `from_` is in reach: an own packet shows no route."""
        self._technique.can_communicate_with_node(from_)

    def says_connected(self, kind: int, payload: bytes) -> bool:
        return kind == MessageType.PRESENT and messages.present_body(payload)[1]

    def on_delivered(self, neighbour: int, tries: int) -> None:
        self._delivery.delivered(neighbour, tries)

    def on_undelivered(self, payload: bytes, tries: int) -> None:
        creator, _from, _kind, _to, forward = messages.header(payload)
        if (creator, forward) == (self._node_id, self.gateway) and messages.asks_for_place(payload):
            self._connection.swallowing.not_taken()
        if not self._delivery.undelivered(payload, tries):
            self._forwarding.not_taken(payload, self._deadlines.now_s)

    def search(self, node: int) -> bool:
        return self._search.search(node)

    # For the delivery: see IWayFinder --------------------------------------------------------

    def on_neighbour_lost(self, node: int) -> None:  # noqa: D102
        if self._medium.policy.checks_soon and self._states.connected:
            share = CHANGE_PERIODS * (0.5 + self._rng.random())
            soon_s = self._deadlines.now_s + share * self._check_period_s
            self._deadlines.set(Due.CHECK, min(soon_s, self._deadlines.at_s[Due.CHECK]))
        self._connection.on_route_lost()
        self._host.on_neighbour_lost(node)

    def on_route_lost(self) -> None:  # noqa: D102
        if self._technique.TAKES_SHORTCUTS:  # others soon learn another route from their neighbours
            self._connection.on_route_lost()

    def another_next_hop(self, node: int, but: int) -> int:  # noqa: D102
        return self._connection.another_next_hop(but) if node == self.gateway else NO_ROUTE

    def way_up(self, but: int) -> int:  # noqa: D102
        to = self.next_hop()
        if to == self._node_id:
            return NO_ROUTE
        return to if to != but else self.another_next_hop(self.gateway, but)

    # For the routing technique: see IRoutingEssentials ---------------------------------------

    def get_node_id(self) -> int:
        return self._node_id

    def get_preferred_gateway(self) -> int:
        return self.gateway

    def get_connected_to_gateway(self) -> bool:
        return self.connected

    def search_other_nodes_in_range(self) -> None:
        self._introduction.broadcast()

    def send_heartbeat(self, other: int) -> bool:
        """Send a heartbeat to `other`; the preferred gateway is expected to answer."""
        if other == self.gateway:
            return self._connection.send_heartbeat()
        return self._answer_search(other)

    def _answer_search(self, gateway: int) -> bool:
        """Send a heartbeat even if one is under way: that one may have been lost."""
        return self._delivery.send_own(messages.addressed(self._heartbeat(), gateway))

    def send_heartbeats(self, others: Sequence[int]) -> None:
        """Send a heartbeat to each of these; those for direct neighbours leave together.

        The preferred gateway's is sent as if alone. On a busy channel, skip neighbours that were
        heard recently.
        """
        gateway = self.gateway
        if gateway in others and not self._connection.proven():
            self._connection.send_heartbeat()
        since_s = math.inf
        patience = max(self._antenna.patience(), self._medium.heard_periods)
        if patience > 0.0:
            since_s = self._deadlines.now_s - patience * self._check_period_s
        heard_s = self._neighbours.last_heard_s
        others = [
            other
            for other in others
            if other != gateway and heard_s(other, otherwise=since_s) <= since_s
        ]
        self._delivery.send_own_to_each(self._heartbeat(), others)

    def _heartbeat(self) -> bytes:
        me, way = self._node_id, self._connection
        return self._introduction.heartbeat(me, me, way.connected, way.gateway)

    def now_s(self) -> float:
        return self._deadlines.now_s

    @property
    def medium(self) -> Medium:
        return self._medium

    def wake_at(self, at_s: float) -> None:
        self._deadlines.set(Due.ROUTING, at_s)

    def send_packet(self, kind: int, neighbour: int, body: bytes) -> bool:
        me = self._node_id
        packet = messages.packet(kind, me, me, neighbour, neighbour, body)
        return self._delivery.send(packet, neighbour)

    def broadcast_packet(self, kind: int, body: bytes) -> None:
        me = self._node_id
        self._antenna.broadcast_message(messages.packet(kind, me, me, BROADCAST, BROADCAST, body))

    def own_place(self) -> Location | None:
        return self._pilot.location()

    def place_of(self, node: int) -> Location | None:
        places = self._places
        if node == self.gateway:
            return places.gateway
        return places.good if node == places.good_id else None
