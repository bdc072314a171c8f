"""Places that nodes ask for and tell, and what a drone in flight hears of others.

A REQUESTLOCATION, which its addressee answers with a LOCATION; and LAST_PLACE: where another node
was last heard, for a drone that is about to land near there (docs/repair.md, "Places of silent
drones").
"""

from __future__ import annotations

import math
from typing import NamedTuple

from drone_mesh.communication.control.parts import NodeBasics, NodeParts
from drone_mesh.communication.interfaces import BROADCAST
from drone_mesh.communication.wire import messages
from drone_mesh.communication.wire.packet_types import MessageType
from drone_mesh.drone.location import Location

NEAR_CLEARANCES = 3.0  # a drone that moves aside once is still within that
MOST_TOLD = 4  # more drones do not stand that near to one place
_BODY = MessageType.LAST_PLACE.about.layout
_OLDEST_AGE_S = 2**16 - 1


def ask_for_place(parts: NodeParts, node: int) -> None:
    """Ask `node` for its place, along the route to it."""
    parts.delivery.send_own(request(parts, node))


def ask_all_for_places(parts: NodeParts, may_fly_on: bool = False) -> None:
    """Ask every node in range for its place; `may_fly_on`: also of others near, as in flight."""
    parts.antenna.broadcast_message(request(parts, BROADCAST, may_fly_on))


def tell_all_place(parts: NodeParts) -> None:
    """Tell every node in range where this one is, or where it flies to: it may fall silent soon."""
    goal = parts.pilot.goal
    place = goal or parts.pilot.location()
    if place is not None:
        packet = messages.own_location(
            place, goal is not None, parts.now_s, parts.node_id, BROADCAST
        )
        parts.antenna.broadcast_message(packet)


def request(parts: NodeBasics, to: int, may_fly_on: bool = False) -> bytes:
    """A request with the place of this node: its destination, if it flies."""
    goal = parts.pilot.goal
    place = goal or parts.pilot.place()
    flies_there = may_fly_on or goal is not None
    return messages.request_for_place(parts.node_id, to, place, flies_there=flies_there)


class LastPlace(NamedTuple):
    """Where a node was last heard."""

    node: int
    place: Location
    age_s: float

    def packet(self, creator: int, to: int) -> bytes:
        """The 32 bytes, from `creator` for `to`."""
        latitude, longitude, height = self.place
        age = max(0, min(_OLDEST_AGE_S, math.ceil(self.age_s)))
        body = _BODY.pack(age, self.node, latitude, longitude, round(height))
        return messages.packet(MessageType.LAST_PLACE, creator, creator, to, to, body)

    @classmethod
    def from_payload(cls, payload: bytes) -> LastPlace:
        """Decode."""
        age, node, *place = _BODY.unpack_from(payload, messages.HEADER_BYTES)
        return cls(node, Location(*place), float(age))


def tell_last_places(parts: NodeParts, asker: int, goal: Location, clearance_m: float) -> None:
    """Tell a drone in flight which nodes were last heard near its goal: it may not hear them."""
    near = sorted(
        (heard.place.distance_m(goal), node, heard)
        for node, heard in parts.neighbours.taken()
        if node not in (asker, parts.node_id)
    )
    for away_m, node, heard in near[:MOST_TOLD]:
        if away_m < NEAR_CLEARANCES * clearance_m:
            last = LastPlace(node, heard.place, parts.now_s - heard.heard_s)
            parts.delivery.send_own(last.packet(parts.node_id, asker))
