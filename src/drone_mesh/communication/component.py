"""MeshnetworkComponent: what a router and a gateway have in common (reference, section 8).

A component has no thread, no clock and no randomness of its own. One thread at a time calls into
it; the getters of IMeshDebugInfo may be read from any other.
"""

from __future__ import annotations

import abc
import math
import random
from typing import Sequence

from drone_mesh.communication import messages
from drone_mesh.communication.complaints import Complaints
from drone_mesh.communication.deadlines import Deadlines, Due
from drone_mesh.communication.delivery import Delivery
from drone_mesh.communication.flight import Flight
from drone_mesh.communication.forwarding import Forwarding
from drone_mesh.communication.interfaces import (
    BROADCAST,
    MAX_NODE_ID,
    NO_ROUTE,
    PAYLOAD_BYTES,
    IMeshDebugInfo,
    IMeshNetwork,
    IRoutingEssentials,
    IRoutingTechnique,
    IWirelessCommunication,
)
from drone_mesh.communication.messages import MessageType
from drone_mesh.communication.observer import (
    MeshEvent,
    MeshEventKind,
    MeshObserver,
    ignore_events,
)
from drone_mesh.communication.timing import FLIGHT_POSITION_PERIOD_S, MeshTiming
from drone_mesh.drone.goal import check_goal
from drone_mesh.drone.interfaces import IDroneEngine, Location
from drone_mesh.errors import GoalRefused, LocationUnknown

INTRODUCE_AFTER_POWER_S = 0.2  # our choice: the medium has to hear of the antenna first
INTRODUCE_SPREAD_S = 1.0  # our choice: after an outage not everybody speaks at once

_HEARTBEAT = int(MessageType.HEARTBEAT)
_PRESENT = int(MessageType.PRESENT)
_TYPES_WITH_NUMBERS = frozenset(
    (MessageType.LOCATION, MessageType.MOVE_TO_LOCATION, MessageType.MOVEMENT_NEGOTIATION)
)


class MeshnetworkComponent(IMeshNetwork, IMeshDebugInfo, IRoutingEssentials):
    """Receives, learns, forwards and sends for one node."""

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
            raise ValueError(f"node id {node_id}: must be 0..{MAX_NODE_ID}")
        self._node_id = node_id
        self._antenna = antenna
        self._engine = engine
        self._routing = routing
        self._rng = rng
        self._timing = timing or MeshTiming()
        self._observer = observer
        self._debug = debug
        self._now_s = 0.0
        self._connected = False
        self._preferred_gateway = NO_ROUTE
        self._hops = NO_ROUTE
        self._gateway_location: Location | None = None
        self._good_location: Location | None = None
        self._good_location_id = NO_ROUTE
        self._deadlines = Deadlines()
        self._flight: Flight | None = None
        self.complaints = Complaints(node_id)
        self._delivery = Delivery(
            node_id,
            antenna,
            routing,
            self._timing.send_attempts,
            self._report,
            self._on_neighbour_lost,
        )
        self._forwarding = Forwarding(
            node_id, routing, self._delivery, self.complaints, self._report
        )

    # Driven from outside ---------------------------------------------------------------------

    def start(self, now_s: float) -> None:
        """Antenna on, debugging on if asked, then look for others. The first check comes later."""
        self._now_s = now_s
        self._antenna.start_antenna(self)
        if self._debug:
            self._antenna.debugging_mode(self, True)
        first_check_s = now_s + self._rng.random() * self._timing.check_period_s
        self._deadlines.set(Due.CHECK, first_check_s)
        self._report(MeshEventKind.STARTED)
        self._begin()
        self._routing.start_routing(self)

    def stop(self) -> None:
        """Antenna and debugging off; nothing is due any more."""
        self._deadlines.clear()
        self._flight = None
        if self._debug:
            self._antenna.debugging_mode(self, False)
        self._antenna.stop_antenna()

    @property
    def next_tick_s(self) -> float:
        """When `tick` wants to be called next. May change with every call into the component."""
        return self._deadlines.next_s

    def tick(self, now_s: float) -> None:
        """Do what is due."""
        self._now_s = now_s
        deadlines = self._deadlines
        if now_s >= deadlines.get(Due.INTRODUCE):
            deadlines.set(Due.INTRODUCE, math.inf)
            self.search_other_nodes_in_range()
        if now_s >= deadlines.get(Due.ASK_POSITION):
            self._watch_flight()
        due_s = deadlines.get(Due.CHECK)
        if now_s >= due_s:
            period_s = self._timing.check_period_s
            deadlines.set(Due.CHECK, due_s + period_s * ((now_s - due_s) // period_s + 1.0))
            if self._antenna.on():
                self._check(due_s)
            else:
                self._antenna_is_off()

    def on_msg(self, payload: bytes, now_s: float) -> None:
        """Learn from a packet, then process it or send it on. Bad packets are dropped."""
        self._now_s = now_s
        if len(payload) != PAYLOAD_BYTES:
            self._drop(f"want {PAYLOAD_BYTES} bytes, got {len(payload)}", payload)
            return
        creator, from_, kind, to, forward = payload[: messages.HEADER_BYTES]
        me = self._node_id
        if creator > MAX_NODE_ID or from_ > MAX_NODE_ID or from_ == me or forward > BROADCAST:
            self._drop("bad ids", payload)
            return
        if to != me:
            self._drop("not for this node", payload)
            return
        if kind in _TYPES_WITH_NUMBERS and not messages.is_finite(payload):
            self._drop("not a finite number", payload)
            return
        heard_s = self._delivery.heard_s
        if from_ not in heard_s:
            self._report(MeshEventKind.NEIGHBOUR_FOUND, from_)
        heard_s[from_] = now_s
        self._routing.can_communicate_with_node(from_)
        if creator not in (from_, me):
            self._learn_path(creator, from_, kind)
        if forward not in (me, BROADCAST):
            self._forwarding.forward(payload, now_s)
        elif kind == _HEARTBEAT:
            body = messages.HeartbeatMessage.BODY.unpack_from(payload, messages.HEADER_BYTES)
            self._on_heartbeat(creator, from_, *body)
        elif kind == _PRESENT:
            body = messages.IntroduceMessage.BODY.unpack_from(payload, messages.HEADER_BYTES)
            self._on_present(creator, *body)
        else:
            self._process(payload, creator, from_, kind)

    def on_antenna_power(self, on: bool, now_s: float) -> None:
        """Switched on: introduce soon. Switched off: a router is not connected at once."""
        self._now_s = now_s
        self._report(MeshEventKind.POWER_ON if on else MeshEventKind.POWER_OFF)
        introduce_s = now_s + INTRODUCE_AFTER_POWER_S if on else math.inf
        self._deadlines.set(Due.INTRODUCE, introduce_s)
        if not on:
            self._antenna_is_off()

    def on_antenna_registered(self, now_s: float) -> None:
        """The medium came back: introduce soon, each node at its own moment."""
        self._now_s = now_s
        if self._antenna.on():
            wait_s = INTRODUCE_AFTER_POWER_S + self._rng.random() * INTRODUCE_SPREAD_S
            self._deadlines.set(Due.INTRODUCE, now_s + wait_s)

    # Snapshots -------------------------------------------------------------------------------

    def get_node_id(self) -> int:
        """This node's id, 0..253."""
        return self._node_id

    def get_connected_to_gateway(self) -> bool:
        """Whether a gateway answered last time, or may still answer."""
        return self._connected

    def get_total_message_sent(self) -> int:
        """Packets sent successfully, own and forwarded ones, broadcasts not counted."""
        return self._delivery.total_sent

    def get_preferred_gateway(self) -> int:
        """Id of the gateway this node uses, or NO_ROUTE while it knows none."""
        return self._preferred_gateway

    def get_hops_from_gateway_away(self) -> int:
        """Hops to the preferred gateway; 255 while not known."""
        return self._hops

    def get_last_good_known_location_id(self) -> int:
        """Id of the node whose place this one would fly to, or NO_ROUTE."""
        return self._good_location_id

    def get_router_tech_table_size(self) -> int:
        """Known nodes; one that is known through two neighbours counts twice."""
        return self._routing.get_table_size()

    def get_neighbours(self) -> dict[int, float]:
        """Direct neighbours, and when each was last heard (seconds of the core's clock)."""
        return dict(self._delivery.heard_s)

    def get_route_to_gateway(self) -> int:
        """The neighbour that leads to the preferred gateway; the own id for a gateway itself."""
        return self.get_direction_to(self._preferred_gateway)

    def get_direction_to(self, node: int) -> int:
        """The neighbour that leads to `node`; the own id for the node itself."""
        if node in (self._node_id, NO_ROUTE):
            return node
        return self._routing.get_direction_to_node(node)

    def get_goal(self) -> Location | None:
        """Where the drone is flying to; None while it is not."""
        flight = self._flight
        return flight.goal if flight is not None else None

    # What a routing technique may ask for ----------------------------------------------------

    def search_other_nodes_in_range(self) -> None:
        """PRESENT, to everybody who hears it."""
        me = self._node_id
        body = messages.IntroduceMessage.BODY.pack(self._hops, self._knows_gateway())
        self._antenna.broadcast_message(
            messages.packet(MessageType.PRESENT, me, me, BROADCAST, BROADCAST, body)
        )

    def send_heartbeat(self, other: int) -> bool:
        """A heartbeat towards `other`."""
        return self._delivery.send_own(_HEARTBEAT, other, self._heartbeat_body())

    def send_heartbeats(self, others: Sequence[int]) -> None:
        """A heartbeat towards each of these; those for direct neighbours leave together."""
        self._delivery.send_own_to_each(_HEARTBEAT, others, self._heartbeat_body())

    # For the router and the gateway to fill in -----------------------------------------------

    @abc.abstractmethod
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
    def _on_negotiation(self, bid: messages.MovementNegotiationMessage) -> None:
        """A neighbour says what it bids for flying."""

    @abc.abstractmethod
    def _flight_started(self) -> None:
        """The drone leaves its place."""

    def _on_neighbour_lost(self, node: int) -> None:
        """A neighbour could not be handed a packet; the routes know already."""

    def _knows_gateway(self) -> bool:
        """What the packets of this node say of its connection."""
        return self._connected

    # Receiving -------------------------------------------------------------------------------

    def _learn_path(self, creator: int, from_: int, kind: int) -> None:
        routing = self._routing
        if kind == _HEARTBEAT:
            routing.proven_path_to_node(from_, creator)
        elif routing.get_direction_to_node(creator) == NO_ROUTE:
            routing.other_can_communicate_with_node(from_, creator)

    def _process(self, payload: bytes, creator: int, from_: int, kind: int) -> None:
        if kind == MessageType.LOCATION:
            self._on_location(messages.LocationMessage.from_payload(payload))
        elif kind == MessageType.REQUESTLOCATION:
            self._tell_location(creator)
        elif kind == MessageType.MISSING:
            missing = messages.MissingMessage.from_payload(payload).missing
            if missing != self._node_id:
                self._delivery.forget_route(creator, missing, told_by=from_)
        elif kind == MessageType.MOVE_TO_LOCATION:
            self._on_order(messages.GoToLocationMessage.from_payload(payload))
        elif kind == MessageType.MOVEMENT_NEGOTIATION:
            self._on_negotiation(messages.MovementNegotiationMessage.from_payload(payload))
        else:
            self._drop("a type that is not processed", payload)

    def _on_location(self, message: messages.LocationMessage) -> None:
        location = Location(message.latitude, message.longitude, message.height)
        if message.creator != self._preferred_gateway:
            self._set_good_location(message.creator, location)
            return
        self._gateway_location = location
        if self.get_route_to_gateway() == message.creator:
            self._set_good_location(message.creator, location)

    def _on_order(self, order: messages.GoToLocationMessage) -> None:
        goal = Location(order.latitude, order.longitude, order.height)
        try:
            check_goal(*goal)
        except GoalRefused as error:
            self.complaints.add("order refused", str(error), self._now_s)
            return
        self._take_order(order.creator, goal)

    def _drop(self, reason: str, payload: bytes) -> None:
        self.complaints.dropped(reason, payload, self._now_s)

    def _heartbeat_body(self) -> bytes:
        return messages.HeartbeatMessage.BODY.pack(
            self._knows_gateway(), self._preferred_gateway, 0
        )

    def _tell_location(self, asker: int) -> None:
        location = self._own_location()
        if location is not None:
            body = messages.LocationMessage.BODY.pack(
                *_on_the_wire(location), int(self._now_s) % 2**32
            )
            self._delivery.send_own(MessageType.LOCATION, asker, body)

    # Flight ----------------------------------------------------------------------------------

    def _take_order(self, creator: int, goal: Location) -> None:
        if self._flight is not None and self._flight.goal == goal:
            return  # a second gateway orders the same flight (reference 14.11)
        self._report(MeshEventKind.FLIGHT_ORDERED, creator, _in_words(goal))
        self._fly_to(goal)

    def _fly_to(self, goal: Location) -> None:
        self._flight = Flight(goal)
        self._deadlines.set(Due.ASK_POSITION, self._now_s + FLIGHT_POSITION_PERIOD_S)
        self._engine.set_goal(*goal)
        self._flight_started()

    def _watch_flight(self) -> None:
        assert self._flight is not None
        if not self._flight.is_over(self._own_location()):
            self._deadlines.set(Due.ASK_POSITION, self._now_s + FLIGHT_POSITION_PERIOD_S)
            return
        self._flight = None
        self._deadlines.set(Due.ASK_POSITION, math.inf)
        self._landed()

    def _landed(self) -> None:
        """The neighbourhood is another one now."""
        self._forget_neighbourhood()
        self._report(MeshEventKind.LANDED)
        self.search_other_nodes_in_range()

    def _forget_neighbourhood(self) -> None:
        self._delivery.heard_s.clear()
        self._routing.node_moved_location()

    def _own_location(self) -> Location | None:
        try:
            location = self._engine.get_location()
            if not all(map(math.isfinite, location)):
                raise LocationUnknown(f"the drone says it is at {location}")
            return location
        except LocationUnknown as error:
            self.complaints.add("own location unknown", str(error), self._now_s)
            return None

    def _set_good_location(self, node: int, location: Location | None) -> None:
        self._good_location = location
        self._good_location_id = NO_ROUTE if location is None else node

    def _report(self, kind: MeshEventKind, peer: int = NO_ROUTE, detail: str = "") -> None:
        self._observer(MeshEvent(kind, self._node_id, self._now_s, peer, detail))


def _in_words(place: Location) -> str:
    return f"to x {place.longitude:.2f} m, y {place.latitude:.2f} m, z {place.height:.0f} m"


def _on_the_wire(location: Location) -> tuple[float, float, int]:
    """Heights travel as int16, whole metres (reference, section 11)."""
    height = max(-(2**15), min(2**15 - 1, round(location.height)))
    return location.latitude, location.longitude, height
