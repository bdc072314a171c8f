"""MeshnetworkComponent: what a router and a gateway have in common (docs/protocol.md).

It takes in packets, time and orders, and hands each to the part that deals with it. A component
has no thread, no clock and no randomness of its own. One thread at a time calls into it; the
getters of IMeshDebugInfo may be read from any other.
"""

from __future__ import annotations

import abc
import math
import random
from typing import Sequence

from drone_mesh.communication import messages
from drone_mesh.communication.complaints import Complaints
from drone_mesh.communication.data.transport import Transport
from drone_mesh.communication.deadlines import Deadlines, Due
from drone_mesh.communication.delivery import Delivery
from drone_mesh.communication.flight import Pilot
from drone_mesh.communication.forwarding import Forwarding
from drone_mesh.communication.frames import TYPES_WITH_PLACES, CommonFrame
from drone_mesh.communication.interfaces import (
    BROADCAST,
    MAX_NODE_ID,
    NO_ROUTE,
    PAYLOAD_BYTES,
    IMeshDebugInfo,
    IMeshNetwork,
    IWirelessCommunication,
)
from drone_mesh.communication.introduction import Introduction
from drone_mesh.communication.medium import ChannelUse
from drone_mesh.communication.messages import (
    TYPES_WITH_NUMBERS,
    HeartbeatMessage,
    IntroduceMessage,
    MessageType,
)
from drone_mesh.communication.neighbours import Neighbours
from drone_mesh.communication.node_reports import NodeReporter
from drone_mesh.communication.node_search import NodeSearch
from drone_mesh.communication.observer import (
    MeshEventKind,
    MeshObserver,
    Reporter,
    ignore_events,
)
from drone_mesh.communication.order_messages import OrderQuery
from drone_mesh.communication.orders import OrderIntake
from drone_mesh.communication.parts import NodeParts
from drone_mesh.communication.places import KnownPlaces
from drone_mesh.communication.repair_status import NOTHING_TO_REPAIR, RepairStatus
from drone_mesh.communication.routing_interfaces import IRoutingEssentials, IRoutingTechnique
from drone_mesh.communication.timing import MeshTiming
from drone_mesh.drone.interfaces import IDroneEngine, Location

SILENCE_PERIODS = 1.5  # our choice: each neighbour is asked once a check period

_HEARTBEAT = int(MessageType.HEARTBEAT)
_PRESENT = int(MessageType.PRESENT)
_LOCATION = int(MessageType.LOCATION)


class MeshnetworkComponent(IMeshNetwork, IMeshDebugInfo, IRoutingEssentials):
    """One node: receives, learns, and dispatches."""

    def __init__(
        self,
        node_id: int,
        antenna: IWirelessCommunication,
        engine: IDroneEngine,
        routing: IRoutingTechnique,
        rng: random.Random,
        timing: MeshTiming | None = None,
        observer: MeshObserver = ignore_events,
        debug: bool = True,
    ) -> None:
        """`rng` spreads what many nodes would do at once; with debug on the antenna shows the node.

        Raises ValueError for a node id outside 0..253.
        """
        if not 0 <= node_id <= MAX_NODE_ID:
            raise ValueError(f"invalid node id {node_id}: must be 0..{MAX_NODE_ID}")
        self._node_id = node_id
        self._antenna = antenna
        self._shared = antenna.medium.shared
        self._routing = routing
        self._rng = rng
        self._timing = timing or MeshTiming()
        self._debug = debug
        self._deadlines = Deadlines()
        self._neighbours = Neighbours(SILENCE_PERIODS * self._timing.check_period_s)
        self._report = Reporter(node_id, self._deadlines, observer)
        self.complaints = Complaints(node_id)
        self._delivery = Delivery(
            node_id,
            antenna,
            routing,
            self._neighbours,
            self._deadlines,
            self._timing.send_attempts,
            self._report,
            self._on_neighbour_lost,
        )
        self._forwarding = Forwarding(
            node_id, routing, self._delivery, self.complaints, self._report
        )
        self.places = KnownPlaces()
        self._frame = CommonFrame(engine.frame_digest())
        self._pilot = Pilot(engine, self._deadlines, self.complaints)
        self._parts = NodeParts(
            node_id,
            self._timing,
            self._deadlines,
            self._report,
            routing,
            self._neighbours,
            self._delivery,
            self.places,
            self._pilot,
            antenna,
        )
        self._introduction = Introduction(
            self._parts, self, self._frame, rng, lambda neighbour: self.send_heartbeat(neighbour)
        )
        self._search = NodeSearch(self._parts, self._answer_search)
        self._orders = OrderIntake(self._parts, self.complaints, self._took_off)
        self._reporter = NodeReporter(self._parts, self)
        room = messages.BODY_BYTES - antenna.reserved_bytes(messages.DATA_TYPES.start)
        self.data = Transport(self._parts, self.complaints, rng, self.get_preferred_gateway, room)

    # Driven from outside ---------------------------------------------------------------------

    def start(self, now_s: float) -> None:
        """Antenna on, debugging on if asked, then look for others. The first check comes later."""
        self._deadlines.now_s = now_s
        self._antenna.start_antenna(self)
        if self._debug:
            self._antenna.debugging_mode(self, True)
        first_check_s = now_s + self._rng.random() * self._timing.check_period_s
        self._deadlines.set(Due.CHECK, first_check_s)
        self._reporter.start(share=(first_check_s - now_s) / self._timing.check_period_s)
        self._report(MeshEventKind.STARTED)
        self._begin()
        self._routing.start_routing(self)

    def stop(self) -> None:
        """Antenna and debugging off; nothing is due any more."""
        self._pilot.forget_flight()
        self._deadlines.clear()
        if self._debug:
            self._antenna.debugging_mode(self, False)
        self._antenna.stop_antenna()

    @property
    def next_tick_s(self) -> float:
        """When `tick` wants to be called next. May change with every call into the component."""
        return self._deadlines.next_s

    def tick(self, now_s: float) -> None:
        """Do what is due."""
        deadlines = self._deadlines
        deadlines.now_s = now_s
        if now_s >= deadlines.get(Due.INTRODUCE):
            self._introduction.on_due()
        if now_s >= deadlines.get(Due.ROUTING):
            deadlines.set(Due.ROUTING, math.inf)
            self._routing.on_time(now_s)
        if now_s >= deadlines.get(Due.ASK_POSITION):
            self._watch_flight()
        if now_s >= deadlines.get(Due.ORDER_REPLIES):
            self._orders.on_due()
        if now_s >= deadlines.get(Due.DATA):
            self.data.on_due()
        if now_s >= deadlines.get(Due.NODE_REPORT):
            self._reporter.on_due()
        due_s = deadlines.get(Due.CHECK)
        if now_s >= due_s:
            period_s = self._timing.check_period_s
            deadlines.set(Due.CHECK, due_s + period_s * ((now_s - due_s) // period_s + 1.0))
            if self._antenna.on():
                self._check(due_s)
            else:
                self._antenna_is_off()

    def on_msg(self, payload: bytes, now_s: float) -> None:
        """Learn from a packet, then process or forward it. Bad packets are dropped."""
        self._deadlines.now_s = now_s
        if len(payload) != PAYLOAD_BYTES:
            self._drop(f"expected {PAYLOAD_BYTES} bytes, got {len(payload)}", payload)
            return
        creator, from_, kind, to, forward = messages.header(payload)
        me = self._node_id
        if creator > MAX_NODE_ID or from_ > MAX_NODE_ID or from_ == me or forward > BROADCAST:
            self._drop("bad ids", payload)
            return
        if to != me:
            self._drop("not for this node", payload)
            return
        if kind in TYPES_WITH_NUMBERS and not messages.is_finite(payload):
            self._drop("not a finite number", payload)
            return
        if self._neighbours.heard(from_, now_s):
            self._report(MeshEventKind.NEIGHBOUR_FOUND, from_)
            self._on_neighbour_found(from_)
        if creator == me:  # it came back and teaches no route
            self._routing.can_communicate_with_node(from_)
        elif not self._routing.learn(creator, from_, kind, payload):
            return
        if kind == _PRESENT and creator == from_ and not self._frame.heard(creator, payload):
            self.complaints.add("another origin", f"that of node {creator}", now_s)
        if kind in TYPES_WITH_PLACES and self._frame.refuses(from_):
            self._drop("a place from a node whose origin is another, or not known yet", payload)
            return
        if forward not in (me, BROADCAST):
            if kind == _HEARTBEAT:
                if self._shared:
                    self._on_passing_heartbeat(creator, *HeartbeatMessage.body(payload))
            elif kind == _LOCATION:
                self._on_passing_location(creator, payload)
            self._forwarding.forward(payload, now_s)
        elif kind == _HEARTBEAT:
            self._on_heartbeat(creator, from_, *HeartbeatMessage.body(payload))
        elif kind == _PRESENT:
            self._on_present(creator, *IntroduceMessage.body(payload))
        else:
            self._process(payload, creator, from_, kind)

    def on_delivered(self, neighbour: int, tries: int, now_s: float) -> None:
        """The routes learn from this."""
        self._deadlines.now_s = now_s
        self._delivery.delivered(neighbour, tries)

    def on_undelivered(self, payload: bytes, tries: int, now_s: float) -> None:
        """Send the packet over another route, if there is one; the routes learn from this."""
        self._deadlines.now_s = now_s
        if not self._delivery.undelivered(payload, tries):
            self._forwarding.stranded(payload, now_s)

    def on_antenna_power(self, on: bool, now_s: float) -> None:
        """Switched on: introduce soon. Switched off: a router is not connected at once."""
        self._deadlines.now_s = now_s
        self._report(MeshEventKind.POWER_ON if on else MeshEventKind.POWER_OFF)
        self._introduction.on_power(on)
        if not on:
            self._antenna_is_off()

    def on_antenna_registered(self, now_s: float) -> None:
        """The medium came back: introduce soon, each node at its own moment."""
        self._deadlines.now_s = now_s
        if self._antenna.on():
            self._introduction.on_registered()

    # Snapshots -------------------------------------------------------------------------------

    def get_node_id(self) -> int:
        """This node's id, 0..253."""
        return self._node_id

    def get_total_message_sent(self) -> int:
        """Packets sent successfully, own and forwarded ones, broadcasts not counted."""
        return self._delivery.total_sent

    def get_last_good_known_location_id(self) -> int:
        """Id of the node whose place this one would fly to, or NO_ROUTE."""
        return self.places.good_id

    def get_router_tech_table_size(self) -> int:
        """Known nodes; one that is known through two neighbours counts twice."""
        return self._routing.get_table_size()

    def get_neighbours(self) -> dict[int, float]:
        """Direct neighbours, and when each was last heard (seconds of the core's clock)."""
        return self._neighbours.heard_s()

    def get_route_to_gateway(self) -> int:
        """The neighbour that leads to the preferred gateway; the own id for a gateway itself."""
        return self.get_direction_to(self.get_preferred_gateway())

    def get_direction_to(self, node: int) -> int:
        """The neighbour that leads to `node`; the own id for the node itself."""
        if node in (self._node_id, NO_ROUTE):
            return node
        return self._routing.get_direction_to_node(node)

    def get_repair_status(self) -> RepairStatus:
        """What the node does about a lost connection, and why."""
        return NOTHING_TO_REPAIR

    def get_channel_use(self) -> ChannelUse:
        """What the antenna does on a shared channel."""
        return self._antenna.channel_use()

    def get_goal(self) -> Location | None:
        """Where the drone is flying to; None while it is not."""
        return self._pilot.goal

    # What a routing technique may ask for ----------------------------------------------------

    def search_other_nodes_in_range(self) -> None:
        """PRESENT, to each node in range."""
        self._introduction.broadcast()

    def send_heartbeat(self, other: int) -> bool:
        """A heartbeat towards `other`."""
        return self._delivery.send_own(messages.addressed(self._heartbeat(), other))

    def send_heartbeats(self, others: Sequence[int]) -> None:
        """A heartbeat towards each of these; those for direct neighbours leave together.

        On a busy channel, neighbours that were heard lately are left out.
        """
        patience = self._antenna.patience()
        if patience > 0.0:
            since_s = self._deadlines.now_s - patience * self._timing.check_period_s
            heard_s = self._neighbours.last_heard_s
            others = [other for other in others if heard_s(other, otherwise=since_s) <= since_s]
        self._delivery.send_own_to_each(self._heartbeat(), others)

    def now_s(self) -> float:
        """The time of the component's latest call."""
        return self._deadlines.now_s

    def wake_at(self, at_s: float) -> None:
        """Have the technique's `on_time` called then."""
        self._deadlines.set(Due.ROUTING, at_s)

    def send_packet(self, kind: int, neighbour: int, body: bytes) -> bool:
        """A packet of the technique's own type to a neighbour."""
        me = self._node_id
        return self._delivery.send(
            messages.packet(kind, me, me, neighbour, neighbour, body), neighbour
        )

    def broadcast_packet(self, kind: int, body: bytes) -> None:
        """A packet of the technique's own type to each node in range."""
        me = self._node_id
        self._antenna.broadcast_message(messages.packet(kind, me, me, BROADCAST, BROADCAST, body))

    def own_place(self) -> Location | None:
        """Where the drone is, if it can report that."""
        return self._pilot.location()

    def place_of(self, node: int) -> Location | None:
        """The last place reported by `node`, or None."""
        if node == self.get_preferred_gateway():
            return self.places.gateway
        return self.places.good if node == self.places.good_id else None

    # For the router and the gateway to fill in -----------------------------------------------

    def _begin(self) -> None:
        """The start of this kind of node, before routing starts."""

    @abc.abstractmethod
    def _check(self, due_s: float) -> None:
        """What is to be done once a period while the antenna is on; it was due at `due_s`."""

    @abc.abstractmethod
    def _antenna_is_off(self) -> None:
        """The antenna was switched off, or a check finds it off."""

    @abc.abstractmethod
    def _on_present(self, neighbour: int, hops: int, know_gateway: bool) -> None:
        """A neighbour introduced itself; the body is that of an IntroduceMessage."""

    @abc.abstractmethod
    def _on_heartbeat(
        self, creator: int, from_: int, know_gateway: bool, preferred_gateway: int, hops: int
    ) -> None:
        """A heartbeat for this node arrived; the body is that of a HeartbeatMessage."""

    @abc.abstractmethod
    def _on_negotiation(
        self, bid: messages.MovementNegotiationMessage, gateway: messages.GatewayPlace | None
    ) -> None:
        """A neighbour bids for the flight; `gateway`: the place that its announcement is about."""

    @abc.abstractmethod
    def _took_off(self) -> None:
        """The drone leaves its place because of an order."""

    def _on_passing_heartbeat(
        self, creator: int, know_gateway: bool, preferred_gateway: int, hops: int
    ) -> None:
        """On a shared medium: a heartbeat for another node is about to be forwarded."""

    def _on_passing_location(self, creator: int, payload: bytes) -> None:
        """A LOCATION for another node is about to be forwarded."""

    @abc.abstractmethod
    def _on_location(
        self, node: int, location: Location, gateway: messages.GatewayPlace | None
    ) -> None:
        """`node` says where it is, and perhaps where a gateway was."""

    def _on_gateway_place(self, gateway: messages.GatewayPlace) -> None:
        """A node says where a gateway was."""

    def _on_goal(self, neighbour: int, goal: Location) -> None:
        """A neighbour says where it is about to fly."""

    def _on_neighbour_found(self, node: int) -> None:
        """A packet arrived from a node that was not a neighbour."""

    def _on_neighbour_lost(self, node: int) -> None:
        """A packet could not be handed to a neighbour; the routes know already."""

    # Receiving -------------------------------------------------------------------------------

    def _process(self, payload: bytes, creator: int, from_: int, kind: int) -> None:
        if kind == MessageType.LOCATION:
            location = messages.LocationMessage.from_payload(payload).location
            self._on_location(creator, location, messages.GatewayPlace.from_payload(payload))
            if creator == from_ and messages.addressee(payload) == BROADCAST:
                self._on_goal(creator, location)
        elif kind == MessageType.GATEWAY_PLACE:
            gateway = messages.GatewayPlace.from_payload(payload)
            if gateway is not None:
                self._on_gateway_place(gateway)
        elif kind == MessageType.REQUESTLOCATION:
            self._send_location(creator)
        elif kind == MessageType.MISSING:
            missing = messages.MissingMessage.from_payload(payload).missing
            if missing != self._node_id:
                self._on_missing(creator, missing, told_by=from_)
        elif kind == MessageType.MOVE_TO_LOCATION:
            order = messages.GoToLocationMessage.from_payload(payload)
            self._orders.on_order(order, messages.order_number(payload))
        elif kind == MessageType.MOVEMENT_NEGOTIATION:
            bid = messages.MovementNegotiationMessage.from_payload(payload)
            self._on_negotiation(bid, messages.GatewayPlace.from_payload(payload))
        elif kind in messages.DATA_TYPES:
            self.data.on_packet(payload)
        elif kind in messages.TECHNIQUE_TYPES:
            self._routing.on_packet(creator, from_, kind, messages.body(payload))
        elif kind in messages.REPORT_TYPES:
            self._on_report(payload, creator, kind)
        else:
            self._drop("a type that is not processed", payload)

    def _on_report(self, payload: bytes, creator: int, kind: int) -> None:
        """A report, or the request for one, for this node."""
        if kind == MessageType.ORDER_QUERY:
            self._orders.on_query(creator, OrderQuery.number_in(payload))
        elif kind == MessageType.NODE_SEARCH:
            self._search.on_packet(creator, payload)
        else:
            self._drop("a type that is not processed", payload)

    def _on_missing(self, creator: int, missing: int, told_by: int) -> None:
        """`creator` says that it cannot reach the node `missing`."""
        self._delivery.forget_route(creator, missing, told_by)

    def _drop(self, reason: str, payload: bytes) -> None:
        self.complaints.dropped(reason, payload, self._deadlines.now_s)

    def _answer_search(self, gateway: int) -> bool:
        """A heartbeat even if one is under way: that one may have gone where no route leads."""
        return self._delivery.send_own(messages.addressed(self._heartbeat(), gateway))

    def _heartbeat(self) -> bytes:
        me = self._node_id
        connected, gateway = self.get_connected_to_gateway(), self.get_preferred_gateway()
        return self._parts.heartbeat(me, me, connected, gateway)

    def _send_location(self, asker: int) -> None:
        location = self._pilot.goal or self._pilot.location()  # where it will stand counts
        if location is not None:
            me, now_s, places = self._node_id, self._deadlines.now_s, self.places
            answer = messages.LocationMessage.of(location, now_s, me, me, asker, asker).to_payload()
            if places.gateway is not None:
                gateway, age_s = self.get_preferred_gateway(), now_s - places.gateway_seen_s
                extension = messages.GatewayPlace(gateway, places.gateway, age_s)
                if self._antenna.reserved_bytes(MessageType.LOCATION):
                    self._delivery.send_own(extension.to_payload(me, me, asker, asker))
                else:
                    answer = extension.behind(answer)
            self._delivery.send_own(answer)

    # Flight ----------------------------------------------------------------------------------

    def _watch_flight(self) -> None:
        if self._pilot.watch():
            self._landed()

    def _landed(self) -> None:
        """The drone is somewhere else, with other neighbours."""
        self._neighbours.forget_all()
        self._routing.node_moved_location()
        self._report(MeshEventKind.LANDED)
        self.search_other_nodes_in_range()
        self._orders.on_landed()
