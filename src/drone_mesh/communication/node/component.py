"""MeshnetworkComponent: the common part of router and gateway (docs/protocol.md).

It receives packets, time and orders, and passes each to the part that handles it. A component has
no thread, clock or randomness of its own. One thread at a time calls it; any thread may call the
getters of IMeshDebugInfo.
"""

from __future__ import annotations

import abc
import math
import struct

from drone_mesh.communication.control.place_requests import LastPlace, tell_last_places
from drone_mesh.communication.events.observer import MeshEventKind
from drone_mesh.communication.interfaces import (
    BROADCAST,
    MAX_NODE_ID,
    PAYLOAD_BYTES,
    IMeshNetwork,
)
from drone_mesh.communication.node.mesh_node import MeshNode
from drone_mesh.communication.timing.deadlines import Deadlines, Due
from drone_mesh.communication.wire import messages
from drone_mesh.communication.wire.packet_types import (
    FLOATS,
    TYPES_WITH_PLACES,
    MessageType,
    receivers,
)
from drone_mesh.drone.location import Location

_PRESENT = int(MessageType.PRESENT)
_LOCATION = int(MessageType.LOCATION)
_MOVE_TO_LOCATION = int(MessageType.MOVE_TO_LOCATION)


class MeshnetworkComponent(MeshNode, IMeshNetwork):
    """One node: receives packets, learns from them, dispatches them."""

    # Driven from outside ---------------------------------------------------------------------

    def start(self, now_s: float) -> None:
        """Start the antenna, and debugging if configured; schedule the first check; introduce."""
        self._deadlines.now_s = now_s
        self._receivers = receivers(self._drop_unknown, self, self.control, self.data, self._orders)
        self._antenna.start_antenna(self)
        if self._debug:
            self._antenna.debugging_mode(self, True)
        first_check_s = now_s + self._rng.random() * self._timing.check_period_s
        self._deadlines.set(Due.CHECK, first_check_s)
        self._reporter.start(share=(first_check_s - now_s) / self._timing.check_period_s)
        self._report(MeshEventKind.STARTED)
        self._begin()
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
        """Do what is due."""
        deadlines = self._deadlines
        deadlines.now_s = now_s
        at_s = deadlines.at_s
        self.control.on_time(now_s)
        if now_s >= at_s[Due.ASK_POSITION]:
            self._watch_flight()
        if now_s >= at_s[Due.ORDER_REPLIES]:
            self._orders.on_due()
        if now_s >= at_s[Due.DATA]:
            self.data.on_due()
        if now_s >= at_s[Due.NODE_REPORT]:
            self._reporter.on_due()
        if now_s >= at_s[Due.OWN_ID]:
            deadlines.set(Due.OWN_ID, math.inf)
            self._antenna.switch_power(True)
        due_s = at_s[Due.CHECK]
        if now_s >= due_s:
            period_s = self._timing.check_period_s
            deadlines.set(Due.CHECK, due_s + period_s * ((now_s - due_s) // period_s + 1.0))
            if self._antenna.on():
                self._check(due_s)
            else:
                self._antenna_is_off()

    def _check(self, due_s: float) -> None:
        self.control.check(due_s)

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
            self._own_id_heard(kind, payload, now_s)
            return
        if creator > MAX_NODE_ID or from_ > MAX_NODE_ID or forward > BROADCAST:
            self._drop("a packet with invalid ids", payload)
            return
        if to != me:
            self._drop("a packet for another node", payload)
            return
        if kind in FLOATS and not messages.is_finite(payload):
            self._drop("a packet with a number that is not finite", payload)
            return
        if self._neighbours.heard(from_, now_s):
            self._report(MeshEventKind.NEIGHBOUR_FOUND, from_)
            self._on_neighbour_found(from_)
        if creator == me:  # it came back, so it teaches no route
            self.control.own_came_back(from_)
        elif not self._learn(creator, from_, kind, payload):
            return
        if kind == _PRESENT and creator == from_:
            self._parts.heard_origin(creator, messages.frame_digest(payload))
        if kind in TYPES_WITH_PLACES and self._frame.refuses(from_):
            self._drop("a place from a node with another or an unknown origin", payload)
            # From a neighbour that has not introduced itself yet, the order is only dropped: its
            # gateway repeats it.
            if kind == _MOVE_TO_LOCATION and self._frame.is_foreign(from_):
                order = messages.GoToLocationMessage.from_payload(payload)
                orders = self._orders
                tell = orders.on_foreign_order if forward == me else orders.on_foreign_passage
                tell(order, messages.order_number(payload), from_)
            return
        if forward != me and forward != BROADCAST:
            if kind == _LOCATION:
                self._on_passing_location(creator, payload)
            self._forward(payload, creator, from_, kind, forward, now_s)
        else:
            self._receivers[kind](payload, creator, from_)

    def _own_id_heard(self, kind: int, payload: bytes, now_s: float) -> None:
        """Another radio uses this node's id: name it, show that it is taken, or give way."""
        self.complaints.own_id_heard(now_s)
        own_id = self._own_id
        if not self._served and own_id.was_heard and self.control.says_connected(kind, payload):
            self._deadlines.set(Due.OWN_ID, own_id.give_way(now_s))
            self._antenna.switch_power(False)
        elif own_id.heard(now_s):
            self.control.introduce()

    def on_delivered(self, neighbour: int, tries: int, now_s: float) -> None:
        """A neighbour has received a packet; the routes learn from this."""
        self._deadlines.now_s = now_s
        self.control.on_delivered(neighbour, tries)

    def on_undelivered(self, payload: bytes, tries: int, now_s: float) -> None:
        """Send the packet over another route, if there is one; the routes learn from this."""
        self._deadlines.now_s = now_s
        self.control.on_undelivered(payload, tries)

    def on_antenna_power(self, on: bool, now_s: float) -> None:
        """Switched on: introduce the node soon. Switched off: a router disconnects at once."""
        self._deadlines.now_s = now_s
        self._report(MeshEventKind.POWER_ON if on else MeshEventKind.POWER_OFF)
        self.control.on_power(on)
        if not on:
            self._antenna_is_off()

    def on_antenna_registered(self, now_s: float) -> None:
        """The medium is back: introduce the node soon, each node at a different moment."""
        self._deadlines.now_s = now_s
        self.control.on_registered()

    # Implemented by router and gateway -------------------------------------------------------

    @property
    def _served(self) -> bool:
        """Whether the mesh knows this node, so that another one with its id gives way to it."""
        return True  # a gateway is looked for as soon as it starts

    def _begin(self) -> None:
        """Start this kind of node, before routing starts."""

    def _antenna_is_off(self) -> None:
        """Called when the antenna is off: it was switched off, or a check finds it so."""

    def _on_passing_location(self, creator: int, payload: bytes) -> None:
        """A LOCATION for another node is about to be forwarded."""

    @abc.abstractmethod
    def _on_location(
        self, node: int, location: Location, is_goal: bool, gateway: messages.GatewayPlace | None
    ) -> None:
        """`node` reports its place, or where it flies to, and perhaps the place of a gateway."""

    def _on_goal(self, neighbour: int, goal: Location) -> None:
        """A neighbour announces where it is about to fly."""

    def _on_neighbour_found(self, node: int) -> None:
        """A packet arrived from a node that was not a neighbour."""

    # Receiving: methods for types that every node handles, beside those of its parts -------------

    def receive_location(self, payload: bytes, creator: int, from_: int) -> None:
        """A node's place or goal, and perhaps the place of a gateway."""
        location, is_goal = messages.place_in(payload), messages.is_goal(payload)
        self._on_location(creator, location, is_goal, messages.GatewayPlace.from_payload(payload))
        if is_goal and creator == from_ and messages.addressee(payload) == BROADCAST:
            self._on_goal(creator, location)

    def receive_requestlocation(self, payload: bytes, creator: int, from_: int) -> None:
        """Answer with this node's place; to a drone in flight also with those of silent ones."""
        asker = messages.place_of_asker(payload)
        if asker is None or creator == self._node_id or self._frame.refuses(from_):
            self._send_location(creator)
            return
        place, flies_there = asker
        if flies_there:
            self._neighbours.motion.flies_for_repair(creator, self._deadlines.now_s)
        self._neighbours.set_place(creator, place, self._deadlines.now_s, flies_there)
        self._on_place_taken(place)
        self._send_location(creator)
        if flies_there:
            tell_last_places(self._parts, creator, place, self._options.clearance_m)

    def receive_last_place(self, payload: bytes, _creator: int, _from: int) -> None:
        """Where another node was last heard."""
        last = LastPlace.from_payload(payload)
        if last.node != self._node_id:
            self._on_last_place(last)

    def receive_gateway_place(self, payload: bytes, _creator: int, _from: int) -> None:
        """Ignored here: only a router may fly to where a gateway was."""

    def receive_movement_negotiation(self, payload: bytes, creator: int, from_: int) -> None:
        """Ignored here: only a router takes part in the election of a drone."""

    def receive_seal_challenge(self, payload: bytes, creator: int, _from: int) -> None:
        """Log that a neighbour has a key and this node has none."""
        reason = f"a neighbour, node {creator}, has a mesh key and this node has none"
        self.complaints.foreign(creator, reason, payload, self._deadlines.now_s)

    def _drop_unknown(self, payload: bytes, _creator: int, _from: int) -> None:
        self._drop("a packet of a type that this node does not process", payload)

    def _drop(self, reason: str, payload: bytes) -> None:
        self.complaints.dropped(reason, payload, self._deadlines.now_s)

    def _on_place_taken(self, place: Location) -> None:
        """Called when a node that asks for places is at `place` or flies there."""

    def _on_last_place(self, last: LastPlace) -> None:
        """A node reports where another one was last heard."""
        heard_s = self._deadlines.now_s - last.age_s
        self._neighbours.passes(last.node, last.place, heard_s)

    def _send_location(self, asker: int) -> None:
        goal = self._pilot.goal
        location = goal or self._pilot.location()
        if location is not None:
            me, now_s, places = self._node_id, self._deadlines.now_s, self.places
            answer = messages.own_location(location, goal is not None, now_s, me, asker)
            if places.gateway is not None:
                gateway, age_s = self.get_preferred_gateway(), now_s - places.gateway_seen_s
                extension = messages.GatewayPlace(gateway, places.gateway, age_s)
                if self._parts.has_key:
                    self._parts.delivery.send_own(extension.to_payload(me, me, asker, asker))
                else:
                    answer = extension.appended_to(answer)
            self._parts.delivery.send_own(answer)

    # Flight ----------------------------------------------------------------------------------

    def _watch_flight(self) -> None:
        if self._pilot.watch():
            self._landed()

    def _landed(self) -> None:
        """The drone is at another place and has other neighbours."""
        self._neighbours.forget_all()
        self.control.routes.node_moved_location()
        self._report(MeshEventKind.LANDED)
        self.control.introduce()
        self._orders.on_landed()
