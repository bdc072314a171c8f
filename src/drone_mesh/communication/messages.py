"""The packets of the mesh: 32 bytes, little-endian, zero padded (reference, section 5).

Each class knows its own bytes; nothing else in the package knows an offset, except for the five
header bytes that are named here. The constructor arguments are those of the original encoder, in
its order: creator, from, to, forward, then the body. Any byte value can be encoded and decoded;
whether an id makes sense is judged by the component that receives it (reference 14.9).
"""

from __future__ import annotations

import enum
import math
import struct
from dataclasses import dataclass
from typing import ClassVar, Union

from drone_mesh.communication.interfaces import PAYLOAD_BYTES
from drone_mesh.errors import PacketError

CREATOR, FROM, TYPE, TO, FORWARD = range(5)  # places of the header bytes
HEADER_BYTES = 5
MAX_HOPS = 254  # of a heartbeat (reference, section 8)


class MessageType(enum.IntEnum):
    """Byte 2. Types 128..255 are reserved for users' data (reference 14.9)."""

    NOTDEFINED = 0
    LOCATION = 1  # where its creator is
    REQUESTLOCATION = 2  # asks for a LOCATION
    PRESENT = 3  # "I am here", to everybody in range
    HEARTBEAT = 4  # proof of a path; counts its hops
    MISSING = 5  # its creator can no longer reach a node
    MOVE_TO_LOCATION = 6  # an order to fly
    MOVEMENT_NEGOTIATION = 7  # what its creator bids for flying


@dataclass(frozen=True)
class Message:
    """A header without a body; also REQUESTLOCATION, NOTDEFINED and types that we do not know.

    Of all classes this one alone takes the type as an argument, third, as the original did.
    """

    creator: int  # who made it
    from_: int  # who sends this hop
    type: int
    to: int  # receiver of this hop
    forward: int  # final addressee, 254 = everybody in range

    def to_payload(self) -> bytes:
        """The 32 bytes. Raises PacketError for a value that is no byte."""
        try:
            return packet(self.type, self.creator, self.from_, self.to, self.forward)
        except ValueError as error:
            raise PacketError(f"{self} does not fit a packet: {error}") from error

    @classmethod
    def from_payload(cls, payload: bytes) -> Message:
        """Decode a header; the body is ignored. Raises PacketError unless there are 32 bytes."""
        _check_length(payload)
        return cls(*payload[:HEADER_BYTES])


@dataclass(frozen=True)
class LocationMessage:
    """Where its creator is."""

    TYPE: ClassVar[MessageType] = MessageType.LOCATION
    BODY: ClassVar[struct.Struct] = struct.Struct("<ffhI")

    creator: int  # who made it
    from_: int  # who sends this hop
    to: int  # receiver of this hop
    forward: int  # final addressee, 254 = everybody in range
    latitude: float  # y, metres
    longitude: float  # x, metres
    height: int  # whole metres
    time_since_posix: int  # whole seconds of the creator's clock

    def to_payload(self) -> bytes:
        """The 32 bytes. Raises PacketError for a value that does not fit its field."""
        return _packed(self, self.latitude, self.longitude, self.height, self.time_since_posix)

    @classmethod
    def from_payload(cls, payload: bytes) -> LocationMessage:
        """Decode. Raises PacketError for another length or type."""
        return cls(*_unpacked(cls.TYPE, cls.BODY, payload))


@dataclass(frozen=True)
class IntroduceMessage:
    """PRESENT: "I am here"."""

    TYPE: ClassVar[MessageType] = MessageType.PRESENT
    BODY: ClassVar[struct.Struct] = struct.Struct("<B?")

    creator: int  # who made it
    from_: int  # who sends this hop
    to: int  # receiver of this hop
    forward: int  # final addressee, 254 = everybody in range
    hops_until_gateway: int  # 255 while not known
    know_gateway: bool  # whether its creator is connected

    def to_payload(self) -> bytes:
        """The 32 bytes. Raises PacketError for a value that does not fit its field."""
        return _packed(self, self.hops_until_gateway, self.know_gateway)

    @classmethod
    def from_payload(cls, payload: bytes) -> IntroduceMessage:
        """Decode. Raises PacketError for another length or type."""
        return cls(*_unpacked(cls.TYPE, cls.BODY, payload))


@dataclass(frozen=True)
class HeartbeatMessage:
    """Proof of a path; each node that forwards it adds a hop."""

    TYPE: ClassVar[MessageType] = MessageType.HEARTBEAT
    BODY: ClassVar[struct.Struct] = struct.Struct("<?BB")

    creator: int  # who made it
    from_: int  # who sends this hop
    to: int  # receiver of this hop
    forward: int  # final addressee, 254 = everybody in range
    know_gateway: bool  # whether its creator is connected
    preferred_gateway: int  # 255 while not known
    hops: int  # how often it was forwarded

    @property
    def is_from_gateway(self) -> bool:
        """Whether its creator is a gateway: only a gateway prefers itself."""
        return self.creator == self.preferred_gateway

    def to_payload(self) -> bytes:
        """The 32 bytes. Raises PacketError for a value that does not fit its field."""
        return _packed(self, self.know_gateway, self.preferred_gateway, self.hops)

    @classmethod
    def from_payload(cls, payload: bytes) -> HeartbeatMessage:
        """Decode. Raises PacketError for another length or type."""
        return cls(*_unpacked(cls.TYPE, cls.BODY, payload))


@dataclass(frozen=True)
class MissingMessage:
    """Its creator can no longer reach a node."""

    TYPE: ClassVar[MessageType] = MessageType.MISSING
    BODY: ClassVar[struct.Struct] = struct.Struct("<B")

    creator: int  # who made it
    from_: int  # who sends this hop
    to: int  # receiver of this hop
    forward: int  # final addressee, 254 = everybody in range
    missing: int  # id of that node

    def to_payload(self) -> bytes:
        """The 32 bytes. Raises PacketError for a value that does not fit its field."""
        return _packed(self, self.missing)

    @classmethod
    def from_payload(cls, payload: bytes) -> MissingMessage:
        """Decode. Raises PacketError for another length or type."""
        return cls(*_unpacked(cls.TYPE, cls.BODY, payload))


@dataclass(frozen=True)
class GoToLocationMessage:
    """MOVE_TO_LOCATION: an order to fly to a place."""

    TYPE: ClassVar[MessageType] = MessageType.MOVE_TO_LOCATION
    BODY: ClassVar[struct.Struct] = struct.Struct("<ffh")

    creator: int  # who made it
    from_: int  # who sends this hop
    to: int  # receiver of this hop
    forward: int  # final addressee, 254 = everybody in range
    latitude: float  # y, metres
    longitude: float  # x, metres
    height: int  # whole metres

    def to_payload(self) -> bytes:
        """The 32 bytes. Raises PacketError for a value that does not fit its field."""
        return _packed(self, self.latitude, self.longitude, self.height)

    @classmethod
    def from_payload(cls, payload: bytes) -> GoToLocationMessage:
        """Decode. Raises PacketError for another length or type."""
        return cls(*_unpacked(cls.TYPE, cls.BODY, payload))


@dataclass(frozen=True)
class MovementNegotiationMessage:
    """What its creator bids for flying."""

    TYPE: ClassVar[MessageType] = MessageType.MOVEMENT_NEGOTIATION
    BODY: ClassVar[struct.Struct] = struct.Struct("<f")

    creator: int  # who made it
    from_: int  # who sends this hop
    to: int  # receiver of this hop
    forward: int  # final addressee, 254 = everybody in range
    cost: float  # its distance to the gateway in metres; negative: it does not fly

    def to_payload(self) -> bytes:
        """The 32 bytes. Raises PacketError for a value that does not fit its field."""
        return _packed(self, self.cost)

    @classmethod
    def from_payload(cls, payload: bytes) -> MovementNegotiationMessage:
        """Decode. Raises PacketError for another length or type."""
        return cls(*_unpacked(cls.TYPE, cls.BODY, payload))


_TypedMessage = Union[
    LocationMessage,
    IntroduceMessage,
    HeartbeatMessage,
    MissingMessage,
    GoToLocationMessage,
    MovementNegotiationMessage,
]
AnyMessage = Union[Message, _TypedMessage]

_CLASS_OF_TYPE: dict[int, type[AnyMessage]] = {
    MessageType.LOCATION: LocationMessage,
    MessageType.PRESENT: IntroduceMessage,
    MessageType.HEARTBEAT: HeartbeatMessage,
    MessageType.MISSING: MissingMessage,
    MessageType.MOVE_TO_LOCATION: GoToLocationMessage,
    MessageType.MOVEMENT_NEGOTIATION: MovementNegotiationMessage,
}
_HEARTBEAT = int(MessageType.HEARTBEAT)
_HEARTBEAT_HOPS = HEADER_BYTES + 2  # place of the hop count
_NUMBERS: dict[int, struct.Struct] = {  # the floating point numbers at the start of a body
    MessageType.LOCATION: struct.Struct("<ff"),
    MessageType.MOVE_TO_LOCATION: struct.Struct("<ff"),
    MessageType.MOVEMENT_NEGOTIATION: struct.Struct("<f"),
}


def parse(payload: bytes) -> AnyMessage:
    """The message in `payload`, of the class that its type calls for; Message for all others.

    Raises PacketError unless there are 32 bytes.
    """
    _check_length(payload)
    return _CLASS_OF_TYPE.get(payload[TYPE], Message).from_payload(payload)


def packet(kind: int, creator: int, from_: int, to: int, forward: int, body: bytes = b"") -> bytes:
    """The 32 bytes of header and body."""
    return (bytes((creator, from_, kind, to, forward)) + body).ljust(PAYLOAD_BYTES, b"\0")


def next_hop(payload: bytes, from_: int, to: int) -> bytes | None:
    """The same packet, sent on by `from_` to `to`; a heartbeat counts the hop.

    None for a heartbeat that has made as many hops as it may.
    """
    sent_on = bytearray(payload)
    sent_on[FROM] = from_
    sent_on[TO] = to
    if payload[TYPE] == _HEARTBEAT:
        if payload[_HEARTBEAT_HOPS] >= MAX_HOPS:
            return None
        sent_on[_HEARTBEAT_HOPS] += 1
    return bytes(sent_on)


def identity(payload: bytes) -> bytes:
    """What stays the same while a packet that is no heartbeat is sent on."""
    return payload[:FROM] + payload[TYPE:TO] + payload[FORWARD:]


def is_finite(payload: bytes) -> bool:
    """Whether the numbers of a packet are numbers; True for types without any."""
    numbers = _NUMBERS.get(payload[TYPE])
    return numbers is None or all(map(math.isfinite, numbers.unpack_from(payload, HEADER_BYTES)))


def _packed(message: _TypedMessage, *values: float) -> bytes:
    try:
        body = message.BODY.pack(*values)
        return packet(
            message.TYPE, message.creator, message.from_, message.to, message.forward, body
        )
    except (struct.error, OverflowError, ValueError) as error:
        raise PacketError(f"{message} does not fit its packet: {error}") from error


def _unpacked(kind: MessageType, body: struct.Struct, payload: bytes) -> tuple:
    _check_length(payload)
    creator, from_, found, to, forward = payload[:HEADER_BYTES]
    if found != kind:
        raise PacketError(f"type {found} is not {kind.name} ({kind.value})")
    return (creator, from_, to, forward, *body.unpack_from(payload, HEADER_BYTES))


def _check_length(payload: bytes) -> None:
    if len(payload) != PAYLOAD_BYTES:
        raise PacketError(f"want {PAYLOAD_BYTES} bytes, got {len(payload)}")
