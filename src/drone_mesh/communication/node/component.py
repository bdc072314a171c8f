"""MeshnetworkComponent: the common part of router and gateway (docs/protocol.md).

It receives packets, time and orders, and passes each to the part that handles it. A component has
no thread, clock or randomness of its own. One thread at a time calls it; any thread may call the
getters of IMeshDebugInfo.
"""

from __future__ import annotations

import math
import random
import struct
from dataclasses import dataclass
from typing import Final

from drone_mesh.communication.control.control_plane import (
    ControlledNode,
    IControlHost,
    IControlPlane,
    IControlTechnique,
    ITechnique,
)
from drone_mesh.communication.control.node_part import Receiver, due, receivers, receives, timers
from drone_mesh.communication.control.pilot import Pilot
from drone_mesh.communication.control.places import Claims, CommonFrame, KnownPlaces
from drone_mesh.communication.control.router_states import RouterStates
from drone_mesh.communication.data.transport import Transport
from drone_mesh.communication.events.complaints import Complaints
from drone_mesh.communication.events.observer import (
    MeshEventKind,
    MeshObserver,
    Reporter,
    ignore_events,
)
from drone_mesh.communication.heartbeats.gateway_plane import GatewayHeartbeats
from drone_mesh.communication.heartbeats.plane import HeartbeatPlane
from drone_mesh.communication.interfaces import (
    BROADCAST,
    MAX_NODE_ID,
    NO_SEALS,
    PAYLOAD_BYTES,
    IMeshNetwork,
    IMeshSeals,
    IWirelessCommunication,
)
from drone_mesh.communication.node.flights import Flights
from drone_mesh.communication.node.own_id import OwnId
from drone_mesh.communication.node.snapshots import NodeSnapshots
from drone_mesh.communication.node.whereabouts import Whereabouts
from drone_mesh.communication.orders.intake import OrderIntake
from drone_mesh.communication.repair.options import RepairOptions
from drone_mesh.communication.reports import NodeReporter
from drone_mesh.communication.routing.interfaces import IRoutingTechnique
from drone_mesh.communication.timing import Deadlines, Due, MeshTiming
from drone_mesh.communication.wire import messages
from drone_mesh.communication.wire.packet_types import (
    ABOUT,
    FLOATS,
    TYPES_WITH_PLACES,
    Handler,
    MessageType,
)
from drone_mesh.drone.interfaces import IDroneEngine

_PRESENT: Final = int(MessageType.PRESENT)
_LOCATION: Final = int(MessageType.LOCATION)
_MOVE_TO_LOCATION: Final = int(MessageType.MOVE_TO_LOCATION)
_FLOATS: Final = FLOATS
_WITH_PLACES: Final = TYPES_WITH_PLACES
_OF_ROUTERS = [kind for kind, about in enumerate(ABOUT) if about.handler is Handler.ROUTER]


@dataclass(frozen=True)
class NodeSettings:
    """What every node has and most leave as it is."""

    seals: IMeshSeals = NO_SEALS  # those of its antenna
    timing: MeshTiming = MeshTiming()
    options: RepairOptions = RepairOptions()
    observer: MeshObserver = ignore_events
    debug: bool = True  # the antenna displays the node


AS_IN_THE_DOCUMENT = NodeSettings()


class MeshnetworkComponent(NodeSnapshots, IMeshNetwork, IControlHost):
    """One node: receives packets, learns from them, and hands them to its parts."""

    _flights: Flights
    _whereabouts: Whereabouts

    def __init__(
        self,
        node_id: int,
        antenna: IWirelessCommunication,
        engine: IDroneEngine,
        routing: ITechnique,
        rng: random.Random,
        states: RouterStates | None,
        settings: NodeSettings,
    ) -> None:
        """`rng` spreads simultaneous actions of many nodes.

        `states` are those of a router; a gateway has none.

        Raises ValueError for a node id outside 0..253.
        """
        if not 0 <= node_id <= MAX_NODE_ID:
            raise ValueError(f"invalid node id {node_id}: must be 0..{MAX_NODE_ID}")
        self._node_id = node_id
        self._antenna = antenna
        self._rng = rng
        self._timing = settings.timing.lost_after(routing.connection_lost_after_s)
        self._options, seals = settings.options, settings.seals
        self._has_key = seals.has_key
        self._debug = settings.debug
        self._deadlines = deadlines = Deadlines()
        check_s, medium = self._timing.check_period_s, antenna.medium
        self._report = Reporter(node_id, deadlines, settings.observer)
        self.complaints = complaints = Complaints(node_id)
        self.places = KnownPlaces()
        self._frame = CommonFrame(engine.frame_digest())
        self._claims = Claims(
            self._frame, self.places, complaints, deadlines, self._options.range_m
        )
        self._engine = engine
        self._pilot = Pilot(node_id, engine, deadlines, complaints)
        self.outside_fence = ""  # why the drone may not be where it is; empty: it may
        node = ControlledNode(
            node_id=node_id,
            host=self,
            states=states,
            timing=self._timing,
            deadlines=deadlines,
            report=self._report,
            complaints=complaints,
            places=self.places,
            frame=self._frame,
            claims=self._claims,
            pilot=self._pilot,
            antenna=antenna,
            seals=seals,
            rng=rng,
            range_m=self._options.range_m,
        )
        self.control = control = _control_plane(node, routing)
        self._neighbours = control.neighbours  # asked for each packet, as are these:
        self._learn, self._forward = control.learn, control.forward
        connected_s = -math.inf if states is None else math.inf  # a gateway never gives way
        self._own_id = OwnId(control, antenna, deadlines, complaints, rng, check_s, connected_s)
        self._orders = OrderIntake(
            node_id, control, self._pilot, engine, deadlines, medium, complaints, self._report
        )
        self._reporter = NodeReporter(
            self,
            control,
            self._timing.report_period_s,
            deadlines,
            antenna,
            self._pilot,
            engine,
        )
        self.data = Transport(node_id, control, antenna, seals, deadlines, complaints, rng)
        # A packet or a timer is for the first part that declares it.
        self._parts: list[object] = [self, *control.parts, self.data, self._orders]
        self._parts += [self._reporter, self._own_id]

    # Driven from outside ---------------------------------------------------------------------

    def start(self, now_s: float) -> None:
        """Start the antenna and what is due; introduce the node."""
        self._deadlines.now_s = now_s
        self._receivers: list[Receiver] = [self._drop_unknown] * 256
        for kind in _OF_ROUTERS:
            self._receivers[kind] = _ignore
        for kind, handle in receivers(self._parts).items():
            self._receivers[kind] = handle
        self._timers = [(int(work), do) for work, do in timers(self._parts)]
        self._antenna.start_antenna(self)
        if self._debug:
            self._antenna.debugging_mode(self, True)
        first_check_s = now_s + self._rng.random() * self._timing.check_period_s
        self._deadlines.set(Due.CHECK, first_check_s)
        self._reporter.start(share=(first_check_s - now_s) / self._timing.check_period_s)
        self._report(MeshEventKind.STARTED)
        self.control.start()

    def stop(self) -> None:
        """Stop the antenna and debugging; nothing is due from now on."""
        self._pilot.forget_flight()
        self._deadlines.clear()
        if self._debug:
            self._antenna.debugging_mode(self, False)
        self._antenna.stop_antenna()

    def switch_debug(self) -> None:
        """Start or stop displaying this node."""
        self._debug = not self._debug
        self._antenna.debugging_mode(self, self._debug)

    @property
    def deadlines(self) -> Deadlines:
        """What is due when. A host of many nodes reads its `next_s`: faster than `next_tick_s`."""
        return self._deadlines

    @property
    def next_tick_s(self) -> float:
        """When to call `tick` next. Any call into the component may change it."""
        return self._deadlines.next_s

    def tick(self, now_s: float) -> None:
        self._deadlines.now_s = now_s
        at_s = self._deadlines.at_s
        for work, do in self._timers:
            if now_s >= at_s[work]:
                do()

    def on_msg(self, payload: bytes, now_s: float) -> None:
        """Learn from a packet, then process or forward it. Bad packets are dropped."""
        self._deadlines.now_s = now_s
        try:
            creator, from_, kind, to, forward = messages.header(payload)
        except struct.error:  # cheaper than checking the length of each packet
            self._drop(f"a packet of {len(payload)} bytes instead of {PAYLOAD_BYTES}", payload)
            return
        me = self._node_id
        if from_ == me:
            self._own_id.heard(kind, payload)
            return
        if creator > MAX_NODE_ID or from_ > MAX_NODE_ID or forward > BROADCAST:
            self._drop("a packet with invalid ids", payload)
            return
        if to != me:
            self._drop("a packet for another node", payload)
            return
        if kind in _FLOATS and not messages.is_finite(payload):
            self._drop("a packet with a number that is not finite", payload)
            return
        if self._neighbours.heard(from_, now_s):
            self._report(MeshEventKind.NEIGHBOUR_FOUND, from_)
            self._on_neighbour_found(from_)
        if creator == me:  # it came back, so it teaches no route
            self.control.own_came_back(from_)
        else:
            teaches, room = payload, messages.EXTENSION_ROOM.get(kind)
            if room and self.complaints.is_foreign(from_, now_s):  # the extension is part of a seal
                teaches = messages.extended(payload, bytes(room))
            if not self._learn(creator, from_, kind, teaches):
                return
        if kind == _PRESENT and creator == from_:
            self._claims.heard_origin(creator, messages.frame_digest(payload))
        if kind in _WITH_PLACES and self._frame.refuses(from_):
            self._drop("a place from a node with another or an unknown origin", payload)
            # From a neighbour that has not introduced itself yet, the order is only dropped: its
            # gateway repeats it.
            if kind == _MOVE_TO_LOCATION and self._frame.is_foreign(from_):
                self._orders.on_foreign(payload, from_)
            return
        if forward != me and forward != BROADCAST:
            if kind == _LOCATION:
                self._whereabouts.on_passing_location(creator, payload)
            self._forward(payload, creator, from_, kind, forward, now_s)
        else:
            self._receivers[kind](payload, creator, from_)

    def on_delivered(self, payload: bytes, tries: int, now_s: float) -> None:
        self._deadlines.now_s = now_s
        self.control.on_delivered(messages.receiver(payload), tries)
        if self._tells_own_goal(payload):
            self._flights.told(messages.receiver(payload), messages.place_in(payload))

    def on_undelivered(self, payload: bytes, tries: int, now_s: float) -> None:
        self._deadlines.now_s = now_s
        self.control.on_undelivered(payload, tries)
        if self._tells_own_goal(payload):
            self._flights.not_told(messages.receiver(payload))

    def _tells_own_goal(self, payload: bytes) -> bool:
        if payload[messages.TYPE_AT] != _LOCATION:
            return False
        return payload[messages.CREATOR_AT] == self._node_id and messages.is_goal(payload)

    def on_antenna_power(self, on: bool, now_s: float) -> None:
        """Switched on: introduce the node soon. Switched off: a router disconnects at once."""
        self._deadlines.now_s = now_s
        self._report(MeshEventKind.POWER_ON if on else MeshEventKind.POWER_OFF)
        self.control.on_power(on)
        if not on:
            self._antenna_is_off()

    def on_antenna_registered(self, now_s: float) -> None:
        self._deadlines.now_s = now_s
        self.control.on_registered()

    # Its own timers and packets --------------------------------------------------------------

    @due(Due.CHECK)
    def _on_check(self) -> None:
        now_s, due_s = self._deadlines.now_s, self._deadlines.at_s[Due.CHECK]
        period_s = self._timing.check_period_s
        self._deadlines.set(Due.CHECK, due_s + period_s * ((now_s - due_s) // period_s + 1.0))
        self._look_at_fence()
        if self._antenna.on():
            self._check(due_s)
        else:
            self._antenna_is_off()

    def on_fence(self, now_s: float) -> None:
        self._deadlines.now_s = now_s
        self._pilot.on_fence()
        self._look_at_fence()

    def _look_at_fence(self) -> None:
        """Say so if the drone is outside; it may then only fly inside."""
        fence = self._engine.fences()
        here = self._pilot.place() if fence.rules else None
        why_not = "" if here is None else fence.why_not(here.to_vector())
        if why_not:
            self.complaints.add("the drone is where it may not be", why_not, self._deadlines.now_s)
            if not self.outside_fence:
                self._report(MeshEventKind.OUTSIDE_FENCE, detail=why_not)
        self.outside_fence = why_not

    @receives(MessageType.SEAL_CHALLENGE)
    def _on_seal_challenge(self, payload: bytes, creator: int, _from: int) -> None:
        """Log that a neighbour has a key and this node has none."""
        reason = f"a neighbour, node {creator}, has a mesh key and this node has none"
        self.complaints.foreign(creator, reason, payload, self._deadlines.now_s)

    def _drop_unknown(self, payload: bytes, _creator: int, _from: int) -> None:
        self._drop("a packet of a type that this node does not process", payload)

    def _drop(self, reason: str, payload: bytes) -> None:
        self.complaints.dropped(reason, payload, self._deadlines.now_s)

    # What a router or a gateway does besides -------------------------------------------------

    def _check(self, due_s: float) -> None:
        self.control.check(due_s)

    def _antenna_is_off(self) -> None:
        """Called when the antenna is off: it was switched off, or a check finds it so."""

    def _on_neighbour_found(self, node: int) -> None:
        """A packet arrived from a node that was not a neighbour."""

    # For the control plane -------------------------------------------------------------------

    def on_looks(self, neighbour: int) -> None:
        self._whereabouts.on_looks(neighbour)

    def on_leads(self, neighbour: int) -> None:
        self._whereabouts.on_leads(neighbour)

    def on_node_missing(self, node: int, told: bool) -> None:
        self.data.on_node_missing(node)


def _control_plane(node: ControlledNode, routing: ITechnique) -> IControlPlane:
    if isinstance(routing, IControlTechnique):
        return routing.control_plane(node)
    if not isinstance(routing, IRoutingTechnique):
        raise TypeError(f"{type(routing).__name__} is no technique")
    if node.states is None:
        return GatewayHeartbeats(node, routing)
    return HeartbeatPlane(node, routing, node.states)


def _ignore(_payload: bytes, _creator: int, _from: int) -> None:
    """A packet for routers has reached a gateway."""
