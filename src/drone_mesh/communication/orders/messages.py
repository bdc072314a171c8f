"""The messages of drone and gateway about an order: reports of types 64 and 65.

docs/protocol.md, "Orders". Both bodies fit into 14 bytes, so that they leave room for a seal.
"""

from __future__ import annotations

import enum
import struct
from dataclasses import dataclass
from typing import ClassVar

from drone_mesh.communication.wire import messages
from drone_mesh.communication.wire.messages import HEADER_BYTES
from drone_mesh.communication.wire.packet_types import MessageType
from drone_mesh.communication.wire.text_parts import is_valid, split

TEXT_BYTES = 10  # of a reason, in one packet


class OrderOutcome(enum.IntEnum):
    """The outcome of an order, as reported by the drone."""

    ACCEPTED = 1  # it flies there
    REFUSED = 2  # it stays; with a reason
    ARRIVED = 3  # it is there
    GIVEN_UP = 4  # the flight ended elsewhere; with the reason
    UNKNOWN = 5  # answer to a query: it knows no such order (any more)
    REPLACED = 6  # it flies elsewhere; with the order that came


@dataclass(frozen=True)
class OrderReply:
    """One part of a drone's reply about the order `number` to the gateway that sent it."""

    TYPE: ClassVar[MessageType] = MessageType.ORDER_REPLY
    BODY: ClassVar[struct.Struct] = TYPE.about.layout

    number: int  # 1..65535
    outcome: OrderOutcome
    part: int  # see text_parts.split
    text: bytes  # of the reason, UTF-8, at most TEXT_BYTES

    @classmethod
    def from_payload(cls, payload: bytes) -> OrderReply | None:
        """Decode; None for an invalid outcome or part."""
        number, outcome, part, text = cls.BODY.unpack_from(payload, HEADER_BYTES)
        try:
            known = OrderOutcome(outcome)
        except ValueError:
            return None
        return cls(number, known, part, text) if is_valid(part) else None


def reply_packets(
    number: int, outcome: OrderOutcome, reason: str, creator: int, gateway: int
) -> list[bytes]:
    """The reply in as many packets as its reason needs, from `creator` for `gateway`."""
    bodies = [
        OrderReply.BODY.pack(number, outcome, part, text)
        for part, text in split(reason, TEXT_BYTES)
    ]
    return [
        messages.packet(OrderReply.TYPE, creator, creator, gateway, gateway, body)
        for body in bodies
    ]


class OrderQuery:
    """A gateway asks for the state of an order; the body is its number."""

    TYPE: ClassVar[MessageType] = MessageType.ORDER_QUERY
    BODY: ClassVar[struct.Struct] = TYPE.about.layout

    @classmethod
    def packet(cls, number: int, gateway: int, drone: int) -> bytes:
        """The 32 bytes, from `gateway` for `drone`."""
        return messages.packet(cls.TYPE, gateway, gateway, drone, drone, cls.BODY.pack(number))

    @classmethod
    def number_in(cls, payload: bytes) -> int:
        """The number of the order."""
        return int(cls.BODY.unpack_from(payload, HEADER_BYTES)[0])
