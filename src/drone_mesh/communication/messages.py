"""The packets of the mesh: 32 bytes, little-endian, zero padded (reference, section 5).

Each class knows its own bytes; nothing else in the package knows an offset, except for the five
header bytes that are named here. The constructor arguments are those of the original encoder, in
its order: creator, from, to, forward, then the body. Any byte value can be encoded and decoded;
whether an id makes sense is judged by the component that receives it (reference 14.9).
"""

from __future__ import annotations

import enum
import struct
from dataclasses import astuple, dataclass
from typing import ClassVar

from drone_mesh.communication.interfaces import PAYLOAD_BYTES
from drone_mesh.errors import PacketError

CREATOR, FROM, TYPE, TO, FORWARD = range(5)  # places of the header bytes
HEADER_BYTES = 5


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
        """The 32 bytes."""
        return bytes(astuple(self)).ljust(PAYLOAD_BYTES, b"\0")

    @classmethod
    def from_payload(cls, payload: bytes) -> Message:
        """Decode a header; the body is ignored. Raises PacketError unless there are 32 bytes."""
        _check_length(payload)
        return cls(*payload[:HEADER_BYTES])


@dataclass(frozen=True)
class _TypedMessage:
    """Shared by the messages with a body: a fixed type, and a struct for header and body."""

    TYPE: ClassVar[MessageType]
    WIRE: ClassVar[struct.Struct]

    creator: int  # who made it
    from_: int  # who sends this hop
    to: int  # receiver of this hop
    forward: int  # final addressee, 254 = everybody in range

    def to_payload(self) -> bytes:
        """The 32 bytes. Raises PacketError for a value that does not fit its field."""
        creator, from_, to, forward, *body = astuple(self)
        try:
            packed = self.WIRE.pack(creator, from_, self.TYPE, to, forward, *body)
        except (struct.error, OverflowError) as error:
            raise PacketError(f"{self} does not fit its packet: {error}") from error
        return packed.ljust(PAYLOAD_BYTES, b"\0")

    @classmethod
    def _fields(cls, payload: bytes) -> tuple:  # type: ignore[type-arg]
        """Constructor arguments found in `payload`."""
        _check_length(payload)
        creator, from_, kind, to, forward, *body = cls.WIRE.unpack_from(payload)
        if kind != cls.TYPE:
            raise PacketError(f"type {kind} is not {cls.TYPE.name} ({cls.TYPE.value})")
        return (creator, from_, to, forward, *body)


@dataclass(frozen=True)
class LocationMessage(_TypedMessage):
    """Where its creator is."""

    TYPE = MessageType.LOCATION
    WIRE = struct.Struct("<5BffhI")

    latitude: float  # y, metres
    longitude: float  # x, metres
    height: int  # whole metres
    time_since_posix: int  # whole seconds of the creator's clock

    @classmethod
    def from_payload(cls, payload: bytes) -> LocationMessage:
        """Decode. Raises PacketError for another length or type."""
        return cls(*cls._fields(payload))


@dataclass(frozen=True)
class IntroduceMessage(_TypedMessage):
    """PRESENT: "I am here"."""

    TYPE = MessageType.PRESENT
    WIRE = struct.Struct("<5BB?")

    hops_until_gateway: int  # 255 while not known
    know_gateway: bool

    @classmethod
    def from_payload(cls, payload: bytes) -> IntroduceMessage:
        """Decode. Raises PacketError for another length or type."""
        return cls(*cls._fields(payload))


@dataclass(frozen=True)
class HeartbeatMessage(_TypedMessage):
    """Proof of a path; each node that forwards it adds a hop."""

    TYPE = MessageType.HEARTBEAT
    WIRE = struct.Struct("<5B?BB")

    know_gateway: bool
    preferred_gateway: int  # 255 while not known
    hops: int  # how often it was forwarded

    @property
    def is_from_gateway(self) -> bool:
        """Whether its creator is a gateway: only a gateway prefers itself."""
        return self.creator == self.preferred_gateway

    @classmethod
    def from_payload(cls, payload: bytes) -> HeartbeatMessage:
        """Decode. Raises PacketError for another length or type."""
        return cls(*cls._fields(payload))


@dataclass(frozen=True)
class MissingMessage(_TypedMessage):
    """Its creator can no longer reach a node."""

    TYPE = MessageType.MISSING
    WIRE = struct.Struct("<5BB")

    missing: int  # id of that node

    @classmethod
    def from_payload(cls, payload: bytes) -> MissingMessage:
        """Decode. Raises PacketError for another length or type."""
        return cls(*cls._fields(payload))


@dataclass(frozen=True)
class GoToLocationMessage(_TypedMessage):
    """MOVE_TO_LOCATION: an order to fly to a place."""

    TYPE = MessageType.MOVE_TO_LOCATION
    WIRE = struct.Struct("<5Bffh")

    latitude: float  # y, metres
    longitude: float  # x, metres
    height: int  # whole metres

    @classmethod
    def from_payload(cls, payload: bytes) -> GoToLocationMessage:
        """Decode. Raises PacketError for another length or type."""
        return cls(*cls._fields(payload))


@dataclass(frozen=True)
class MovementNegotiationMessage(_TypedMessage):
    """What its creator bids for flying."""

    TYPE = MessageType.MOVEMENT_NEGOTIATION
    WIRE = struct.Struct("<5Bf")

    cost: float  # its distance to the gateway in metres; negative: it does not fly

    @classmethod
    def from_payload(cls, payload: bytes) -> MovementNegotiationMessage:
        """Decode. Raises PacketError for another length or type."""
        return cls(*cls._fields(payload))


_CLASS_OF_TYPE = {
    cls.TYPE: cls
    for cls in (
        LocationMessage,
        IntroduceMessage,
        HeartbeatMessage,
        MissingMessage,
        GoToLocationMessage,
        MovementNegotiationMessage,
    )
}


def parse(payload: bytes) -> Message | _TypedMessage:
    """The message in `payload`, of the class that its type calls for; Message for all others.

    Raises PacketError unless there are 32 bytes.
    """
    _check_length(payload)
    cls = _CLASS_OF_TYPE.get(payload[TYPE], Message)
    return cls.from_payload(payload)


def next_hop(payload: bytes, from_: int, to: int) -> bytes:
    """The same packet, sent on by `from_` to `to`."""
    return bytes((payload[CREATOR], from_, payload[TYPE], to)) + payload[FORWARD:]


def _check_length(payload: bytes) -> None:
    if len(payload) != PAYLOAD_BYTES:
        raise PacketError(f"want {PAYLOAD_BYTES} bytes, got {len(payload)}")
