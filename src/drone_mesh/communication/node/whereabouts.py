"""Whereabouts: what a node is told of the places of others, and what it tells them.

docs/repair.md, "Places to step back to" and "Places of silent drones".
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Container, NamedTuple

from drone_mesh.communication.control.control_plane import IControlPlane
from drone_mesh.communication.control.node_part import receives
from drone_mesh.communication.control.pilot import Pilot
from drone_mesh.communication.control.places import Claims, CommonFrame, KnownPlaces
from drone_mesh.communication.interfaces import BROADCAST, IWirelessCommunication
from drone_mesh.communication.node.flights import SHORT_FLIGHT
from drone_mesh.communication.repair.connection_repair import ConnectionRepair
from drone_mesh.communication.timing import Deadlines
from drone_mesh.communication.wire import messages
from drone_mesh.communication.wire.messages import GatewayPlace
from drone_mesh.communication.wire.packet_types import MessageType
from drone_mesh.drone.location import Location, metres_between

NEAR_CLEARANCES = 3.0  # a drone that moves aside once is still within that
MOST_TOLD = 4  # more drones do not stand that near to one place
TELL_AGAIN_S = 60.0  # a node that was told may have been restarted, or not have heard it
LOOK_AGAIN_S = 10.0  # beacons come every 2 s


@dataclass(eq=False)
class Whereabouts:
    """The places of others, as a gateway needs them, and the answers of every node."""

    _node_id: int
    _control: IControlPlane
    _deadlines: Deadlines
    _pilot: Pilot
    _antenna: IWirelessCommunication
    _places: KnownPlaces
    _frame: CommonFrame
    _clearance_m: float
    _has_key: bool

    def __post_init__(self) -> None:
        self._tell_s: dict[int, float] = {}  # when to tell each of those behind this node
        self._looked_s: dict[int, float] = {}  # when a neighbour may have been restarted

    @receives(MessageType.LOCATION)
    def on_location(self, payload: bytes, creator: int, from_: int) -> None:
        """A node's place or goal, and perhaps the place of a gateway."""
        place, is_goal = messages.place_in(payload), messages.is_goal(payload)
        self._set_place(creator, place, is_goal, GatewayPlace.from_payload(payload))
        if creator == from_ and messages.addressee(payload) == BROADCAST:
            if is_goal:
                self._flies_to(creator, place)
            else:
                self.on_looks(creator)

    def _set_place(
        self, node: int, place: Location, is_goal: bool, gateway: GatewayPlace | None
    ) -> None:
        """`node` reports its place, or where it flies to, and perhaps the place of a gateway."""
        now_s = self._deadlines.now_s
        self._control.neighbours.set_place(node, place, now_s, is_goal)
        if node == self._control.gateway:
            self._places.update_gateway(place, now_s)
            self._control.gateway_sent_place()

    def _flies_to(self, neighbour: int, goal: Location) -> None:
        """A neighbour announces where it is about to fly."""

    def on_passing_location(self, creator: int, payload: bytes) -> None:
        """A LOCATION for another node is about to be forwarded."""

    @receives(MessageType.REQUESTLOCATION)
    def on_request(self, payload: bytes, creator: int, from_: int) -> None:
        """Answer with this node's place; to a drone in flight also with those of silent ones."""
        asker = messages.place_of_asker(payload)
        if asker is None or creator == self._node_id or self._frame.refuses(from_):
            self._answer(creator)
            return
        place, flies_there = asker
        now_s = self._deadlines.now_s
        if flies_there:
            self._control.neighbours.motion.flies_for_repair(creator, now_s)
        self._control.neighbours.set_place(creator, place, now_s, flies_there)
        self._is_taken(place)
        self._answer(creator, is_here=flies_there and creator == from_)
        if flies_there:
            for packet in self._last_places(place, creator, but=(creator, self._node_id)):
                self._send_back(packet, creator, is_here=creator == from_)
        elif creator == from_ and messages.addressee(payload) == self._node_id:
            self.on_leads(creator)

    def on_looks(self, neighbour: int) -> None:
        """`neighbour` looks for a gateway or has just connected: it may have forgotten all."""
        now_s = self._deadlines.now_s
        if now_s - self._looked_s.get(neighbour, -math.inf) >= LOOK_AGAIN_S:  # anybody may say so
            self._looked_s[neighbour] = now_s
            self._tell_s.pop(neighbour, None)

    def on_leads(self, neighbour: int) -> None:
        """`neighbour` goes on through this node, and may step back to its place one day.

        Who is silent beside that, this node alone may know; beside the neighbour, too, if that may
        have been restarted. It tells all: nobody else asks. While drones move by themselves, those
        have mostly gone on.
        """
        now_s, here = self._deadlines.now_s, self._pilot.place()
        if here is None or now_s < self._tell_s.get(neighbour, -math.inf):
            return
        self._tell_s[neighbour] = now_s + LOOK_AGAIN_S
        neighbours = self._control.neighbours
        if neighbours.motion.moved_since(now_s - neighbours.motion.within_s):
            return
        near = neighbours.ids()
        packets = self._last_places(here, BROADCAST, but={*near, self._node_id})
        there = neighbours.place_of(neighbour)
        if there and now_s - self._looked_s.get(neighbour, -math.inf) < TELL_AGAIN_S:
            packets += self._last_places(there.place, BROADCAST, but={*near, self._node_id})
        if packets:
            self._tell_s.update(dict.fromkeys(near, now_s + TELL_AGAIN_S))
        for packet in dict.fromkeys(packets):
            self._antenna.broadcast_message(packet)

    def _is_taken(self, place: Location) -> None:
        """A node that asks for places is at `place` or flies there."""

    def _answer(self, asker: int, is_here: bool = False) -> None:
        goal = self._pilot.destination
        place = goal or self._pilot.location()
        if place is None:
            return
        me, now_s, places = self._node_id, self._deadlines.now_s, self._places
        answer = messages.own_location(place, goal is not None, now_s, me, asker)
        if places.gateway is not None:
            age_s = now_s - places.gateway_seen_s
            extension = GatewayPlace(self._control.gateway, places.gateway, age_s)
            if self._has_key:
                self._send_back(extension.to_payload(me, asker), asker, is_here)
            else:
                answer = extension.appended_to(answer)
        self._send_back(answer, asker, is_here)

    def _send_back(self, packet: bytes, asker: int, is_here: bool) -> None:
        """Send an answer; to an asker that flies by, here, where it asked.

        Routes lead to where it was, and it may land before they find it.
        """
        delivery = self._control.delivery
        if not (is_here and delivery.send(packet, asker)):
            delivery.send_own(packet)

    def _last_places(self, goal: Location, to: int, but: Container[int]) -> list[bytes]:
        """Packets that tell `to` which nodes, `but` these, were last heard near a goal."""
        me, now_s, near = self._node_id, self._deadlines.now_s, []
        near_m = NEAR_CLEARANCES * self._clearance_m
        for node, heard in self._control.neighbours.taken():
            if node not in but:
                away_m = metres_between(heard.place, goal)
                if away_m < near_m:  # few are
                    near.append((away_m, node, heard.place, heard.heard_s))
        return [
            LastPlace(node, place, now_s - heard_s).packet(me, to)
            for _away_m, node, place, heard_s in sorted(near)[:MOST_TOLD]
        ]

    @receives(MessageType.LAST_PLACE)
    def on_last_place(self, payload: bytes, _creator: int, _from: int) -> None:
        last = LastPlace.from_payload(payload)
        if last.node != self._node_id:
            self._was_heard(last)

    def _was_heard(self, last: LastPlace) -> None:
        heard_s = self._deadlines.now_s - last.age_s
        self._control.neighbours.passes(last.node, last.place, heard_s)


@dataclass(eq=False)
class RouterWhereabouts(Whereabouts):
    """The places of others, as a router needs them that may have to fly for its connection."""

    _claims: Claims
    _repair: ConnectionRepair

    def on_passing_location(self, creator: int, payload: bytes) -> None:
        """Relays use the gateway's place as well, unless only the addressee can check it."""
        if not self._has_key and creator == self._control.gateway:
            place = messages.place_in(payload)
            if self._claims.may_be_at(place, gateway=True, says_so=not messages.is_goal(payload)):
                self._places.update_gateway(place, self._deadlines.now_s)

    def _set_place(
        self, node: int, place: Location, is_goal: bool, gateway: GatewayPlace | None
    ) -> None:
        now_s, control = self._deadlines.now_s, self._control
        is_gateway = node == control.gateway
        # A gateway is followed to its goal; a relay's goal is not where this node had a link to it.
        is_next_hop = node == control.next_hop() and (is_gateway or not is_goal)
        if is_gateway:
            control.gateway_sent_place()
        elif gateway is not None:
            self._gateway_was_at(gateway)
        judged = is_gateway or is_next_hop
        if judged and not self._claims.may_be_at(place, is_gateway, says_so=not is_goal):
            return
        self._control.neighbours.set_place(node, place, now_s, is_goal)
        if is_gateway:
            self._places.update_gateway(place, now_s)
        if is_next_hop:
            self._places.update_next_hop(node, place, now_s)
        self._repair.on_place(node, place)

    def _flies_to(self, neighbour: int, goal: Location) -> None:
        here, range_m = self._pilot.destination or self._pilot.location(), self._repair.range_m
        is_out_of_reach = here is not None and here.distance_m(goal) >= range_m
        # After a longer flight a router has forgotten its routes.
        is_relay = neighbour == self._control.next_hop() != self._control.gateway
        if is_out_of_reach or (
            is_relay and self._control.neighbours.flies_m(neighbour) > SHORT_FLIGHT * range_m
        ):
            self._control.neighbour_leaves(neighbour)

    def _is_taken(self, place: Location) -> None:
        self._repair.on_taken(place)

    def _was_heard(self, last: LastPlace) -> None:
        super()._was_heard(last)
        heard = self._control.neighbours.place_of(last.node)
        if heard is not None:
            self._repair.on_taken(heard.place)
        self._repair.on_taken(last.place)

    @receives(MessageType.GATEWAY_PLACE)
    def on_gateway_place(self, payload: bytes, _creator: int, _from: int) -> None:
        """Where a gateway was, in a mesh with a key."""
        gateway = GatewayPlace.from_payload(payload)
        if gateway is not None:
            self._gateway_was_at(gateway)

    def _gateway_was_at(self, gateway: GatewayPlace) -> None:
        if not self._control.told_of_gateway(gateway.gateway):
            return
        if self._claims.may_be_at(gateway.place, gateway=True, says_so=False):
            seen_s = self._deadlines.now_s - gateway.age_s
            self._places.hear_of_gateway(gateway.place, seen_s, self._control.connected)


_BODY = MessageType.LAST_PLACE.about.layout
_OLDEST_AGE_S = 2**16 - 1


class LastPlace(NamedTuple):
    """Where a node was last heard."""

    node: int
    place: Location
    age_s: float

    def packet(self, creator: int, to: int) -> bytes:
        latitude, longitude, height = self.place
        age = max(0, min(_OLDEST_AGE_S, math.ceil(self.age_s)))
        body = _BODY.pack(age, self.node, latitude, longitude, round(height))
        return messages.packet(MessageType.LAST_PLACE, creator, creator, to, to, body)

    @classmethod
    def from_payload(cls, payload: bytes) -> LastPlace:
        age, node, *place = _BODY.unpack_from(payload, messages.HEADER_BYTES)
        return cls(node, Location(*place), float(age))
