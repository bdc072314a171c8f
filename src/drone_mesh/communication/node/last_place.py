"""LastPlace: where another node was last heard, for a drone that is about to land near there.

docs/repair.md, "Places of silent drones".
"""

from __future__ import annotations

import math
from typing import NamedTuple

from drone_mesh.communication.wire import messages
from drone_mesh.communication.wire.packet_types import MessageType
from drone_mesh.drone.location import Location

_BODY = MessageType.LAST_PLACE.about.layout
_OLDEST_AGE_S = 2**16 - 1


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
