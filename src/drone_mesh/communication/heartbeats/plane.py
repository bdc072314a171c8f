"""HeartbeatPlane: the part of the document's way that routers and gateways have in common."""

from __future__ import annotations

import math
from typing import Sequence

from drone_mesh.communication.control.control_plane import IControlHost, IControlPlane
from drone_mesh.communication.control.parts import NodeBasics
from drone_mesh.communication.heartbeats.delivery import Delivery
from drone_mesh.communication.heartbeats.forwarding import Forwarding
from drone_mesh.communication.heartbeats.introduction import Introduction
from drone_mesh.communication.heartbeats.node_search import NodeSearch
from drone_mesh.communication.heartbeats.parts import HeartbeatParts
from drone_mesh.communication.interfaces import BROADCAST, NO_ROUTE
from drone_mesh.communication.routing.interfaces import IRoutingEssentials, IRoutingTechnique
from drone_mesh.communication.timing.deadlines import Due
from drone_mesh.communication.timing.medium import Medium
from drone_mesh.communication.wire import messages
from drone_mesh.communication.wire.packet_types import MessageType
from drone_mesh.drone.location import Location


class HeartbeatPlane(IControlPlane, IRoutingEssentials):
    """Neighbours, connection and routes by PRESENT, HEARTBEAT and MISSING."""

    def __init__(
        self, basics: NodeBasics, technique: IRoutingTechnique, host: IControlHost
    ) -> None:
        self._host = host
        self._technique = self.routes = technique
        self._antenna = basics.antenna
        self.bids_within_s = basics.timing.check_period_s
        self._deadlines = basics.deadlines
        self._neighbours = basics.neighbours
        self._delivery = self.delivery = Delivery(
            basics,
            technique,
            self._on_neighbour_lost,
            self._another_next_hop,
            self._way_up,
            self._seek,
        )
        self._forwarding = Forwarding(basics, technique, self._delivery)
        self._parts = HeartbeatParts(**vars(basics), routing=technique, delivery=self._delivery)
        self._introduction = Introduction(self._parts, host, lambda node: self.send_heartbeat(node))
        self._search = NodeSearch(self._parts, self._answer_search)
        self._learn_from = technique.learn
        self.learn = self._learn
        self.forward = self._forwarding.forward

    def _learn(self, creator: int, from_: int, kind: int, payload: bytes) -> bool:
        """Learn from a packet, without a foreign neighbour's extension, which is part of a seal."""
        room = messages.EXTENSION_ROOM.get(kind)
        if room and self._parts.complaints.is_foreign(from_, self._deadlines.now_s):
            payload = messages.extended(payload, bytes(room))
        return self._learn_from(creator, from_, kind, payload)

    # Time and surroundings -------------------------------------------------------------------

    def start(self) -> None:
        """Start the technique, which introduces the node."""
        self._delivery.begin()
        self._technique.start_routing(self)

    def on_time(self, now_s: float) -> None:
        """Introduce the node, and let the technique do what it planned."""
        if now_s >= self._deadlines.at_s[Due.INTRODUCE]:
            self._introduction.on_due()
        if now_s >= self._deadlines.at_s[Due.ROUTING]:
            self._deadlines.set(Due.ROUTING, math.inf)
            self._technique.on_time(now_s)

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
        if self._antenna.medium.shared:
            self._delivery.neighbour_lost(neighbour)

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

    def receive_missing(self, payload: bytes, creator: int, from_: int) -> None:
        """`creator` reports that it cannot reach a node."""
        missing = messages.MissingMessage.from_payload(payload).missing
        if missing != self._parts.node_id:
            if missing == self.gateway:
                self._neighbours.set_hops(creator, NO_ROUTE)
            self._delivery.forget_route(creator, missing, from_)
            self._after_missing(missing, messages.addressee(payload) != BROADCAST)

    def _after_missing(self, missing: int, told: bool) -> None:
        """The routes are updated. `told`: this node alone, not all neighbours."""

    def receive_of_technique(self, payload: bytes, creator: int, from_: int) -> None:
        """A packet of the technique's own types."""
        kind = messages.type_of(payload)
        self._technique.on_packet(creator, from_, kind, messages.body(payload))

    def search(self, node: int) -> bool:
        """Ask all nodes for `node`, which answers with a heartbeat."""
        return self._search.search(node)

    def receive_node_search(self, payload: bytes, creator: int, _from: int) -> None:
        """A gateway looks for a node."""
        self._search.on_packet(creator, payload)

    def _on_neighbour_lost(self, node: int) -> None:
        """A neighbour did not take a packet; the routes are already updated."""

    def _another_next_hop(self, node: int, but: int) -> int:
        """A neighbour to try for `node`, not `but`, beside those that the routes know."""
        return NO_ROUTE

    # Users' data for nodes to which there is no route -----------------------------------------

    def _way_up(self, but: int) -> int:
        """A next hop to the preferred gateway, not `but`; NO_ROUTE also if that is this node."""
        to = self.next_hop()
        if to == self._parts.node_id:
            return NO_ROUTE
        return to if to != but else self._another_next_hop(self.gateway, but)

    def _seek(self, node: int) -> bool:
        """Users' data for `node` has no way from here."""
        return False

    # For the routing technique ---------------------------------------------------------------

    def get_node_id(self) -> int:
        """This node's id, 0..253."""
        return self._parts.node_id

    def get_preferred_gateway(self) -> int:
        """The gateway that this node uses, itself for a gateway."""
        return self.gateway

    def get_connected_to_gateway(self) -> bool:
        """Whether a gateway answered the last heartbeat, or may still answer."""
        return self._host.get_connected_to_gateway()

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
        patience = max(self._antenna.patience(), self._antenna.medium.heard_periods)
        if patience > 0.0:
            since_s = self._deadlines.now_s - patience * self._parts.timing.check_period_s
            heard_s = self._neighbours.last_heard_s
            others = [other for other in others if heard_s(other, otherwise=since_s) <= since_s]
        self._delivery.send_own_to_each(self._heartbeat(), others)

    def now_s(self) -> float:
        """The time of the component's latest call."""
        return self._deadlines.now_s

    @property
    def medium(self) -> Medium:
        """The properties of the antenna's medium."""
        return self._antenna.medium

    def wake_at(self, at_s: float) -> None:
        """Call the technique's `on_time` at this time."""
        self._deadlines.set(Due.ROUTING, at_s)

    def send_packet(self, kind: int, neighbour: int, body: bytes) -> bool:
        """Send a packet of the technique's own type to a neighbour."""
        me = self._parts.node_id
        return self._delivery.send(
            messages.packet(kind, me, me, neighbour, neighbour, body), neighbour
        )

    def broadcast_packet(self, kind: int, body: bytes) -> None:
        """Send a packet of the technique's own type to each node in range."""
        me = self._parts.node_id
        self._antenna.broadcast_message(messages.packet(kind, me, me, BROADCAST, BROADCAST, body))

    def own_place(self) -> Location | None:
        """The drone's position, if it can report it."""
        return self._parts.pilot.location()

    def place_of(self, node: int) -> Location | None:
        """The last place reported by `node`, or None."""
        places = self._parts.places
        if node == self.gateway:
            return places.gateway
        return places.good if node == places.good_id else None

    def _answer_search(self, gateway: int) -> bool:
        """Send a heartbeat even if one is under way: that one may have been lost."""
        return self._delivery.send_own(messages.addressed(self._heartbeat(), gateway))

    def _heartbeat(self) -> bytes:
        me = self._parts.node_id
        return self._parts.heartbeat(me, me, self.get_connected_to_gateway(), self.gateway)
