"""HeartbeatPlane: the part of the document's way that routers and gateways have in common."""

from __future__ import annotations

import math
from typing import Sequence

from drone_mesh.communication.control.control_plane import ControlledNode, IControlPlane
from drone_mesh.communication.control.node_part import due, receives
from drone_mesh.communication.heartbeats.delivery import Delivery, ImmediateDelivery
from drone_mesh.communication.heartbeats.forwarding import Forwarding
from drone_mesh.communication.heartbeats.introduction import Introduction
from drone_mesh.communication.heartbeats.node_search import NodeSearch
from drone_mesh.communication.heartbeats.own_heartbeats import OwnHeartbeats
from drone_mesh.communication.heartbeats.queued_delivery import QueuedDelivery
from drone_mesh.communication.interfaces import BROADCAST, NO_ROUTE
from drone_mesh.communication.routing.interfaces import IRoutingEssentials, IRoutingTechnique
from drone_mesh.communication.timing import Due, Medium
from drone_mesh.communication.wire import messages
from drone_mesh.communication.wire.packet_types import ABOUT, Handler, MessageType
from drone_mesh.drone.location import Location

_OF_TECHNIQUES = [number for number in range(256) if ABOUT[number].handler is Handler.TECHNIQUE]


class HeartbeatPlane(IControlPlane, IRoutingEssentials):
    """Neighbours, connection and routes by PRESENT, HEARTBEAT and MISSING."""

    def __init__(self, node: ControlledNode, technique: IRoutingTechnique) -> None:
        self._node_id = node.node_id
        self._technique = self.routes = technique
        self._antenna, self._medium = node.antenna, node.antenna.medium
        self._check_period_s = self.bids_within_s = node.timing.check_period_s
        self._deadlines = node.deadlines
        self._neighbours = node.neighbours
        self._places = node.places
        self._pilot = node.pilot
        deliver = QueuedDelivery if self._medium.shared else ImmediateDelivery
        self._delivery: Delivery = deliver(
            node.node_id,
            technique,
            self,
            node.antenna,
            node.neighbours,
            node.deadlines,
            node.timing.send_attempts,
            node.report,
            node.seals,
        )
        self.delivery = self._delivery
        self._forwarding = Forwarding(
            node.node_id, technique, self._delivery, self._medium, node.complaints, node.report
        )
        self._heartbeats = OwnHeartbeats(node.node_id, technique, node.seals)
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
        self.learn = technique.learn
        self.forward = self._forwarding.forward

    @property
    def parts(self) -> Sequence[object]:
        """Itself and its parts that handle packets and timers."""
        return self, self._introduction, self._search

    # Time and surroundings -------------------------------------------------------------------

    def start(self) -> None:
        """Start the technique, which introduces the node."""
        self._delivery.begin()
        self._technique.start_routing(self)

    @due(Due.ROUTING)
    def on_technique_due(self) -> None:
        """Let the technique do what it planned."""
        self._deadlines.set(Due.ROUTING, math.inf)
        self._technique.on_time(self._deadlines.now_s)

    def on_power(self, on: bool) -> None:
        """Introduce the node soon after the antenna is switched on."""
        self._introduction.on_power(on)

    def on_registered(self) -> None:
        """Introduce the node soon."""
        if self._antenna.on():
            self._introduction.on_registered()

    def introduce(self) -> None:
        """Send PRESENT to each node in range."""
        self._introduction.broadcast()

    def neighbour_leaves(self, neighbour: int) -> None:
        """Look for other routes on a shared medium; elsewhere the next failed packet does so."""
        self._delivery.neighbour_leaves(neighbour)

    # Packets ---------------------------------------------------------------------------------

    def own_came_back(self, from_: int) -> None:
        """Learn only that `from_` is in reach: an own packet shows no route."""
        self._technique.can_communicate_with_node(from_)

    def says_connected(self, kind: int, payload: bytes) -> bool:
        """Whether it is the PRESENT of a connected node."""
        return kind == MessageType.PRESENT and messages.present_body(payload)[1]

    def on_delivered(self, neighbour: int, tries: int) -> None:
        """The routes learn from this."""
        self._delivery.delivered(neighbour, tries)

    def on_undelivered(self, payload: bytes, tries: int) -> None:
        """Send the packet over another route, if there is one; the routes learn from this."""
        if not self._delivery.undelivered(payload, tries):
            self._forwarding.stranded(payload, self._deadlines.now_s)

    @receives(MessageType.MISSING)
    def on_missing(self, payload: bytes, creator: int, from_: int) -> None:
        """`creator` reports that it cannot reach a node."""
        missing = messages.MissingMessage.from_payload(payload).missing
        if missing != self._node_id:
            if missing == self.gateway:
                self._neighbours.set_hops(creator, NO_ROUTE)
            self._delivery.forget_route(creator, missing, from_)
            self._after_missing(missing, messages.addressee(payload) != BROADCAST)

    def _after_missing(self, missing: int, told: bool) -> None:
        """The routes are updated. `told`: this node alone, not all neighbours."""

    @receives(*_OF_TECHNIQUES)
    def on_packet_of_technique(self, payload: bytes, creator: int, from_: int) -> None:
        """A packet of the technique's own types."""
        kind = messages.type_of(payload)
        self._technique.on_packet(creator, from_, kind, messages.body(payload))

    def search(self, node: int) -> bool:
        """Ask all nodes for `node`, which answers with a heartbeat."""
        return self._search.search(node)

    def on_neighbour_lost(self, node: int) -> None:
        """See IWayFinder, also for the functions below."""

    def another_next_hop(self, node: int, but: int) -> int:  # noqa: D102
        return NO_ROUTE

    # Users' data for nodes to which there is no route -----------------------------------------

    def way_up(self, but: int) -> int:  # noqa: D102
        to = self.next_hop()
        if to == self._node_id:
            return NO_ROUTE
        return to if to != but else self.another_next_hop(self.gateway, but)

    def seek(self, node: int) -> bool:  # noqa: D102
        return False

    # For the routing technique ---------------------------------------------------------------

    def get_node_id(self) -> int:
        """This node's id, 0..253."""
        return self._node_id

    def get_preferred_gateway(self) -> int:
        """The gateway that this node uses, itself for a gateway."""
        return self.gateway

    def get_connected_to_gateway(self) -> bool:
        """Whether a gateway answered the last heartbeat, or may still answer."""
        return self.connected

    def search_other_nodes_in_range(self) -> None:
        """Send PRESENT to each node in range."""
        self._introduction.broadcast()

    def send_heartbeat(self, other: int) -> bool:
        """Send a heartbeat to `other`."""
        return self._delivery.send_own(messages.addressed(self._heartbeat(), other))

    def send_heartbeats(self, others: Sequence[int]) -> None:
        """Send a heartbeat to each of these; those for direct neighbours leave together.

        On a busy channel, skip neighbours that were heard recently.
        """
        patience = max(self._antenna.patience(), self._medium.heard_periods)
        if patience > 0.0:
            since_s = self._deadlines.now_s - patience * self._check_period_s
            heard_s = self._neighbours.last_heard_s
            others = [other for other in others if heard_s(other, otherwise=since_s) <= since_s]
        self._delivery.send_own_to_each(self._heartbeat(), others)

    def now_s(self) -> float:
        """The time of the component's latest call."""
        return self._deadlines.now_s

    @property
    def medium(self) -> Medium:
        """The properties of the antenna's medium."""
        return self._medium

    def wake_at(self, at_s: float) -> None:
        """Call the technique's `on_time` at this time."""
        self._deadlines.set(Due.ROUTING, at_s)

    def send_packet(self, kind: int, neighbour: int, body: bytes) -> bool:
        """Send a packet of the technique's own type to a neighbour."""
        me = self._node_id
        return self._delivery.send(
            messages.packet(kind, me, me, neighbour, neighbour, body), neighbour
        )

    def broadcast_packet(self, kind: int, body: bytes) -> None:
        """Send a packet of the technique's own type to each node in range."""
        me = self._node_id
        self._antenna.broadcast_message(messages.packet(kind, me, me, BROADCAST, BROADCAST, body))

    def own_place(self) -> Location | None:
        """The drone's position, if it can report it."""
        return self._pilot.location()

    def place_of(self, node: int) -> Location | None:
        """The last place reported by `node`, or None."""
        places = self._places
        if node == self.gateway:
            return places.gateway
        return places.good if node == places.good_id else None

    def _answer_search(self, gateway: int) -> bool:
        """Send a heartbeat even if one is under way: that one may have been lost."""
        return self._delivery.send_own(messages.addressed(self._heartbeat(), gateway))

    def _heartbeat(self) -> bytes:
        me = self._node_id
        return self._heartbeats.packet(me, me, self.connected, self.gateway)
