"""Reports of a node about itself to its gateway: types 66 and 67.

docs/protocol.md, "Node reports". Both bodies fit into 14 bytes, so that they leave room for a seal.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import ClassVar

from drone_mesh.communication.interfaces import NO_ROUTE
from drone_mesh.communication.wire import messages
from drone_mesh.communication.wire.messages import HEADER_BYTES
from drone_mesh.communication.wire.packet_types import MessageType
from drone_mesh.communication.wire.text_parts import split
from drone_mesh.drone.location import Location

STEPS_PER_M = 5  # places are encoded in steps of 0.2 m: 5000 m fit into an int16
UNKNOWN = 255  # in a field of one byte
NO_PLACE = -(2**15)
WORDS_BYTES = 13  # in one packet
_FLYING, _CAN_FLY, _SHARES_ID = 1, 2, 4


@dataclass(frozen=True)
class NodeReport:
    """NODE_REPORT: the state of its creator in figures."""

    TYPE: ClassVar[MessageType] = MessageType.NODE_REPORT
    BODY: ClassVar[struct.Struct] = TYPE.about.layout

    neighbours: int
    hops: int  # to its gateway; 255: not known
    next_hop: int  # towards its gateway; 255: none
    place: Location | None  # to 0.2 m; None: not known
    battery_percent: int | None
    flying: bool
    can_fly: bool
    tries: float  # per packet, to 0.1; 0: not known
    shares_id: bool = False  # another radio uses its id

    def packet(self, creator: int, gateway: int) -> bytes:
        """The 32 bytes, from `creator` for `gateway`."""
        steps = [NO_PLACE] * 3
        if self.place is not None:
            steps = [_int16(round(metres * STEPS_PER_M)) for metres in self.place]
        body = self.BODY.pack(
            min(self.neighbours, UNKNOWN),
            self.hops,
            self.next_hop,
            *steps,
            UNKNOWN if self.battery_percent is None else self.battery_percent,
            self.flying * _FLYING | self.can_fly * _CAN_FLY | self.shares_id * _SHARES_ID,
            min(UNKNOWN, round(self.tries * 10)),
        )
        return messages.packet(self.TYPE, creator, creator, gateway, gateway, body)

    @classmethod
    def from_payload(cls, payload: bytes) -> NodeReport:
        """Decode; any bytes are a valid report."""
        body = cls.BODY.unpack_from(payload, HEADER_BYTES)
        neighbours, hops, next_hop, *steps, battery, flags, tries = body
        place = None if NO_PLACE in steps else Location(*(step / STEPS_PER_M for step in steps))
        return cls(
            neighbours,
            hops,
            next_hop,
            place,
            battery if battery <= 100 else None,
            bool(flags & _FLYING),
            bool(flags & _CAN_FLY),
            tries / 10,
            bool(flags & _SHARES_ID),
        )


class NodeWords:
    """NODE_WORDS: why its creator cannot fly, in one or more packets."""

    TYPE: ClassVar[MessageType] = MessageType.NODE_WORDS
    BODY: ClassVar[struct.Struct] = TYPE.about.layout

    @classmethod
    def packets(cls, words: str, creator: int, gateway: int) -> list[bytes]:
        """All parts, from `creator` for `gateway`."""
        bodies = [cls.BODY.pack(part, text) for part, text in split(words, WORDS_BYTES)]
        return [
            messages.packet(cls.TYPE, creator, creator, gateway, gateway, body) for body in bodies
        ]

    @classmethod
    def part_in(cls, payload: bytes) -> tuple[int, bytes]:
        """The part byte, and the text of that part."""
        part, text = cls.BODY.unpack_from(payload, HEADER_BYTES)
        return part, text


NOTHING_REPORTED = NodeReport(0, NO_ROUTE, NO_ROUTE, None, None, False, False, 0.0)


def _int16(number: int) -> int:
    return max(NO_PLACE + 1, min(2**15 - 1, number))
