"""The packets of the mesh: 32 bytes, little-endian, zero padded.

docs/wire.md, "Packets".

Each class encodes and decodes its own bytes. The offsets of the header, and of the bodies that
every node handles, are defined here alone. A body that belongs to one service is defined beside
that service, also once: `beacon/packets.py`, `data/packets.py`, `orders/intake.py`,
`reports.py` and the routing techniques. The constructor arguments are those of the
original encoder, in its order: creator, from, to, forward, then the body. Any byte value can be
encoded and decoded; the receiving component decides whether an id is valid (docs/wire.md, "Bad
input").
"""

from __future__ import annotations

import math
import operator
import struct
from dataclasses import dataclass, fields
from typing import Callable, ClassVar, Final, Iterable, NamedTuple, TypeVar

from drone_mesh.communication.interfaces import BROADCAST, PAYLOAD_BYTES
from drone_mesh.communication.wire.packet_types import (
    ABOUT,
    DATA_TYPES,
    FLOATS,
    MessageType,
    Priority,
)
from drone_mesh.drone.location import Location
from drone_mesh.errors import PacketError

CREATOR_AT: Final = 0  # offsets of the header bytes
FROM_AT: Final = 1
TYPE_AT: Final = 2
TO_AT: Final = 3
FORWARD_AT: Final = 4
HEADER_BYTES: Final = 5
BODY_BYTES = PAYLOAD_BYTES - HEADER_BYTES
_BYTE: Final = tuple(bytes((value,)) for value in range(256))
_TWICE: Final = tuple(bytes((value, value)) for value in range(256))
QUESTION = 193  # the only type of users' data that is sent again without an answer
QUESTION_AT = HEADER_BYTES + 2  # offset of its nonce; 0: it wants no answer
ROUTE_RECORD: Final = 194  # the only type of users' data to which forwarding nodes add their ids
ROUTE_RECORD_AT = HEADER_BYTES + 2  # offset of the number of ids; the ids follow it
MOST_RECORDED: Final = 16
MAX_HOPS: Final = 254  # of a heartbeat; docs/protocol.md, "Forwarding"


@dataclass(frozen=True)
class Message:
    """A header without a body: REQUESTLOCATION, NOTDEFINED and unknown types.

    Only this class takes the type as an argument, in third place, as the original did.
    """

    creator: int  # the node that made it
    from_: int  # the node that sends this hop
    type: int
    to: int  # receiver of this hop
    forward: int  # final addressee, 254 = every node in range

    def to_payload(self) -> bytes:
        """The 32 bytes. Raises PacketError for a value outside 0..255."""
        try:
            return packet(self.type, self.creator, self.from_, self.to, self.forward)
        except ValueError as error:
            raise PacketError(f"{self} does not fit a packet: {error}") from error

    @classmethod
    def from_payload(cls, payload: bytes) -> Message:
        """Decode a header; the body is ignored. Raises PacketError unless there are 32 bytes."""
        _check_length(payload)
        return cls(*payload[:HEADER_BYTES])


_M = TypeVar("_M", bound="_TypedMessage")


@dataclass(frozen=True)
class _TypedMessage:
    """A header and the body of one type; a subclass adds the declared fields, in their order."""

    TYPE: ClassVar[MessageType]
    BODY: ClassVar[struct.Struct]

    creator: int  # the node that made it
    from_: int  # the node that sends this hop
    to: int  # receiver of this hop
    forward: int  # final addressee, 254 = every node in range

    def to_payload(self) -> bytes:
        """The 32 bytes. Raises PacketError for a value that does not fit its field."""
        creator, from_, to, forward, *body = (getattr(self, field.name) for field in fields(self))
        try:
            return packet(self.TYPE, creator, from_, to, forward, self.BODY.pack(*body))
        except (struct.error, OverflowError, ValueError) as error:
            raise PacketError(f"{self} does not fit its packet: {error}") from error

    @classmethod
    def from_payload(cls: type[_M], payload: bytes) -> _M:
        """Decode. Raises PacketError for another length or type."""
        _check_length(payload)
        creator, from_, kind, to, forward = payload[:HEADER_BYTES]
        if kind != cls.TYPE:
            raise PacketError(f"type {kind} is not {cls.TYPE.name} ({int(cls.TYPE)})")
        return cls(creator, from_, to, forward, *cls.BODY.unpack_from(payload, HEADER_BYTES))


@dataclass(frozen=True)
class LocationMessage(_TypedMessage):
    """The position of its creator, or its goal in flight; see own_location."""

    TYPE: ClassVar[MessageType] = MessageType.LOCATION
    BODY: ClassVar[struct.Struct] = MessageType.LOCATION.about.layout

    latitude: float  # y, metres
    longitude: float  # x, metres
    height: int  # whole metres
    time_since_posix: int  # whole seconds of the creator's clock; highest bit: a goal


@dataclass(frozen=True)
class IntroduceMessage(_TypedMessage):
    """PRESENT: introduces its creator."""

    TYPE: ClassVar[MessageType] = MessageType.PRESENT
    BODY: ClassVar[struct.Struct] = MessageType.PRESENT.about.layout

    hops_until_gateway: int  # 255: not known, or it flies past
    know_gateway: bool  # whether its creator is connected


@dataclass(frozen=True)
class HeartbeatMessage(_TypedMessage):
    """Proof of a path; each node that forwards it adds a hop."""

    TYPE: ClassVar[MessageType] = MessageType.HEARTBEAT
    BODY: ClassVar[struct.Struct] = MessageType.HEARTBEAT.about.layout

    know_gateway: bool  # whether its creator is connected
    preferred_gateway: int  # 255 while not known
    hops: int  # number of nodes that forwarded it


@dataclass(frozen=True)
class MissingMessage(_TypedMessage):
    """Its creator can no longer reach a node."""

    TYPE: ClassVar[MessageType] = MessageType.MISSING
    BODY: ClassVar[struct.Struct] = MessageType.MISSING.about.layout

    missing: int  # id of that node


@dataclass(frozen=True)
class GoToLocationMessage(_TypedMessage):
    """MOVE_TO_LOCATION: an order to fly to a place."""

    TYPE: ClassVar[MessageType] = MessageType.MOVE_TO_LOCATION
    BODY: ClassVar[struct.Struct] = MessageType.MOVE_TO_LOCATION.about.layout

    latitude: float  # y, metres
    longitude: float  # x, metres
    height: int  # whole metres

    @property
    def location(self) -> Location:
        return Location(self.latitude, self.longitude, self.height)


@dataclass(frozen=True)
class MovementNegotiationMessage(_TypedMessage):
    """The bid of its creator to fly."""

    TYPE: ClassVar[MessageType] = MessageType.MOVEMENT_NEGOTIATION
    BODY: ClassVar[struct.Struct] = MessageType.MOVEMENT_NEGOTIATION.about.layout

    cost: float  # its distance to the gateway in metres; negative: it does not fly


def _whole(body: str) -> struct.Struct:
    """Packs the 32 bytes: the header, a body of this format, and zeros."""
    return struct.Struct(f"<{HEADER_BYTES}B{body}{BODY_BYTES - struct.calcsize('<' + body)}x")


_GATEWAY_PLACE: Final = MessageType.GATEWAY_PLACE.about.layout
_GATEWAY_PLACE_AT = {
    int(MessageType.LOCATION): HEADER_BYTES + LocationMessage.BODY.size,
    int(MessageType.MOVEMENT_NEGOTIATION): HEADER_BYTES + MovementNegotiationMessage.BODY.size,
    int(MessageType.GATEWAY_PLACE): HEADER_BYTES,
}
_OLDEST_AGE_S = 2**16 - 2
_REQUESTLOCATION: Final = int(MessageType.REQUESTLOCATION)
# Latitude, longitude, height + 1 and whether it flies there.
_ASKER_PLACE: Final = struct.Struct("<ffH")
_NEW_REQUEST: Final = _whole("ffH")
_FLIES_THERE: Final = 2**15
_GOAL: Final = 2**31  # highest bit of the time in a LOCATION; nothing else uses that
_GOAL_AT: Final = HEADER_BYTES + LocationMessage.BODY.size - 1  # the byte with that bit
_GOAL_BYTE: Final = 2**7
_ORDER_NUMBER = struct.Struct("<H")
_ORDER_NUMBER_AT = HEADER_BYTES + GoToLocationMessage.BODY.size
_FRAME_DIGEST: Final = struct.Struct("<H")
_FRAME_DIGEST_AT: Final = PAYLOAD_BYTES - _FRAME_DIGEST.size  # the last bytes of a PRESENT
_LOCATION: Final = int(MessageType.LOCATION)
_NEW_LOCATION: Final = _whole(LocationMessage.BODY.format[1:])
_PRESENT: Final = int(MessageType.PRESENT)
_NEW_PRESENT: Final = _whole(IntroduceMessage.BODY.format[1:])
_HEARTBEAT: Final = int(MessageType.HEARTBEAT)
_SEAL_ANSWER: Final = int(MessageType.SEAL_ANSWER)
_HEARTBEAT_HOPS: Final = HEADER_BYTES + 2  # offset of the hop count
_NEW_HEARTBEAT: Final = _whole(HeartbeatMessage.BODY.format[1:])
# A packet without the sender and receiver of its hop. Byte 7 counts: the hops of a HEARTBEAT, the
# ids of a ROUTE_RECORD, which follow it.
_WITHOUT_HOP: Final = struct.Struct(f"<BxBx3sB{PAYLOAD_BYTES - ROUTE_RECORD_AT - 1}s")
_NEXT_HOP: Final = struct.Struct(f"<4B3sB{PAYLOAD_BYTES - ROUTE_RECORD_AT - 1}s")
_EXTENSIONS: Final = {  # the bytes after a body that a routing technique may use
    int(MessageType.PRESENT): range(HEADER_BYTES + IntroduceMessage.BODY.size, _FRAME_DIGEST_AT),
    int(MessageType.HEARTBEAT): range(HEADER_BYTES + HeartbeatMessage.BODY.size, PAYLOAD_BYTES),
}


class GatewayPlace(NamedTuple):
    """Where a gateway was: an extension of a LOCATION or a MOVEMENT_NEGOTIATION.

    In a mesh with a key a LOCATION has no room for it, so it is the body of a GATEWAY_PLACE.
    """

    gateway: int  # its id
    place: Location
    age_s: float  # how long ago it was there

    def appended_to(self, payload: bytes) -> bytes:
        """The same packet with this extension after its body."""
        body = self._body()
        at = _GATEWAY_PLACE_AT[payload[TYPE_AT]]
        return payload[:at] + body + payload[at + len(body) :]

    def to_payload(self, creator: int, to: int) -> bytes:
        """As a packet of its own."""
        return packet(MessageType.GATEWAY_PLACE, creator, creator, to, to, self._body())

    def _body(self) -> bytes:
        age = 1 + max(0, min(_OLDEST_AGE_S, math.ceil(self.age_s)))
        latitude, longitude, height = self.place
        return _GATEWAY_PLACE.pack(age, self.gateway, latitude, longitude, round(height))

    @classmethod
    def from_payload(cls, payload: bytes) -> GatewayPlace | None:
        """The extension of such a packet; None if there is no valid one."""
        at = _GATEWAY_PLACE_AT[payload[TYPE_AT]]
        age, gateway, *place = _GATEWAY_PLACE.unpack_from(payload, at)
        if age == 0 or not all(map(math.isfinite, place)):
            return None
        return cls(gateway, Location(*place), age - 1.0)


# Used for each packet: none of these calls a Python function.

header: Final[Callable[[bytes], tuple[int, int, int, int, int]]] = struct.Struct(
    f"<{HEADER_BYTES}B{BODY_BYTES}x"
).unpack
"""Creator, from, type, to and forward of 32 bytes. Raises struct.error for another length."""


hop: Final[Callable[[bytes], tuple[int, int]]] = struct.Struct("<xBxB").unpack_from
"""The sender and the receiver of this hop."""

_SKIP_HEADER = f"<{HEADER_BYTES}x"

heartbeat_body: Final[Callable[[bytes], tuple[bool, int, int]]] = struct.Struct(
    _SKIP_HEADER + HeartbeatMessage.BODY.format[1:]
).unpack_from
"""Whether the creator of a HEARTBEAT knows a gateway, which, and the hops so far."""

preferred_gateway: Final[Callable[[bytes], int]] = operator.itemgetter(HEADER_BYTES + 1)
"""The gateway of the creator of a HEARTBEAT; see heartbeat_body."""

present_body: Final[Callable[[bytes], tuple[int, bool]]] = struct.Struct(
    _SKIP_HEADER + IntroduceMessage.BODY.format[1:]
).unpack_from
"""The hops of the creator of a PRESENT to its gateway, and whether it knows one."""

sender: Final[Callable[[bytes], int]] = operator.itemgetter(FROM_AT)
"""The node that sends this hop."""

receiver: Final[Callable[[bytes], int]] = operator.itemgetter(TO_AT)
"""The node that this hop is for."""

type_of: Final[Callable[[bytes], int]] = operator.itemgetter(TYPE_AT)
"""The type of a packet; see MessageType."""

addressee: Final[Callable[[bytes], int]] = operator.itemgetter(FORWARD_AT)
"""The final addressee of a packet, or BROADCAST."""

body: Final[Callable[[bytes], bytes]] = operator.itemgetter(slice(HEADER_BYTES, None))
"""The 27 bytes after the header."""


def is_jittered(payload: bytes) -> bool:
    """Whether a packet of this type, if it goes to all or once, waits for a random time."""
    return ABOUT[payload[TYPE_AT]].jittered


def goes_once(payload: bytes) -> bool:
    """Whether the radio tries a packet of this type only once."""
    return ABOUT[payload[TYPE_AT]].once


def opens_others(payload: bytes) -> bool:
    """Whether its receiver may be unable to open later packets of its sender before it."""
    return payload[TYPE_AT] == _SEAL_ANSWER


def is_answered(payload: bytes) -> bool:
    """Whether several nodes send at once when they hear a broadcast of this type."""
    return ABOUT[payload[TYPE_AT]].answered


def is_data(payload: bytes) -> bool:
    """Whether it is a packet of users' data, of any type."""
    return payload[TYPE_AT] >= DATA_TYPES.start


def priority(payload: bytes) -> Priority:
    """Whether it goes before or after other packets."""
    return ABOUT[payload[TYPE_AT]].priority


def asks_for_place(payload: bytes) -> bool:
    """Whether it is a REQUESTLOCATION: a node is connected without an answer to that."""
    return payload[TYPE_AT] == _REQUESTLOCATION


def readdressed(payload: bytes, to: int) -> bytes:
    """The same packet with `to` as the receiver of this hop."""
    return payload[:TO_AT] + _BYTE[to] + payload[TO_AT + 1 :]


def copies_for(payload: bytes, receivers: Iterable[int]) -> list[bytes]:
    """For each of these nodes the same packet with it as the receiver of this hop."""
    start, end = payload[:TO_AT], payload[TO_AT + 1 :]
    return [start + _BYTE[to] + end for to in receivers]


def addressed(payload: bytes, other: int) -> bytes:
    """The same packet for the neighbour `other`, as receiver of this hop and as addressee."""
    return payload[:TO_AT] + _TWICE[other] + payload[FORWARD_AT + 1 :]


def packet(kind: int, creator: int, from_: int, to: int, forward: int, body: bytes = b"") -> bytes:
    """The 32 bytes of header and body."""
    return (bytes((creator, from_, kind, to, forward)) + body).ljust(PAYLOAD_BYTES, b"\0")


def place_in(location: bytes) -> Location:
    """The place in a LOCATION, without creating the object: every tenth packet is one."""
    return Location(*LocationMessage.BODY.unpack_from(location, HEADER_BYTES)[:3])


def own_location(place: Location, is_goal: bool, now_s: float, me: int, to: int) -> bytes:
    """A new LOCATION of node `me`: where it is, or its goal while it flies there.

    Heights are int16, whole metres.
    """
    latitude, longitude, height_m = place
    height = max(-(2**15), min(2**15 - 1, round(height_m)))
    time_s = int(now_s) % _GOAL + is_goal * _GOAL
    return _NEW_LOCATION.pack(me, me, _LOCATION, to, to, latitude, longitude, height, time_s)


def is_goal(location: bytes) -> bool:
    """Whether the creator of a LOCATION is still on its way to the place in it."""
    return location[_GOAL_AT] >= _GOAL_BYTE


def request_for_place(creator: int, to: int, place: Location | None, flies_there: bool) -> bytes:
    """A new REQUESTLOCATION; `place`: of its creator, which is on its way to it if it flies."""
    if place is None:
        return _NEW_REQUEST.pack(creator, creator, _REQUESTLOCATION, to, to, 0.0, 0.0, 0)
    latitude, longitude, height = place
    code = 1 + max(0, min(_FLIES_THERE - 2, round(height))) + flies_there * _FLIES_THERE
    return _NEW_REQUEST.pack(creator, creator, _REQUESTLOCATION, to, to, latitude, longitude, code)


def place_of_asker(request: bytes) -> tuple[Location, bool] | None:
    """The place in a REQUESTLOCATION, and whether its creator flies there; None: no valid one."""
    latitude, longitude, code = _ASKER_PLACE.unpack_from(request, HEADER_BYTES)
    height = (code & ~_FLIES_THERE) - 1
    if height < 0 or not (math.isfinite(latitude) and math.isfinite(longitude)):
        return None
    return Location(latitude, longitude, height), code >= _FLIES_THERE


def present(sender: int, hops: int, know_gateway: bool) -> bytes:
    """The bytes of a new IntroduceMessage for every node in range, without the object."""
    return _NEW_PRESENT.pack(sender, sender, _PRESENT, BROADCAST, BROADCAST, hops, know_gateway)


def heartbeat(
    creator: int, from_: int, to: int, forward: int, know_gateway: bool, preferred_gateway: int
) -> bytes:
    """The bytes of a new HeartbeatMessage, without the object, as every fifth packet is one."""
    return _NEW_HEARTBEAT.pack(
        creator, from_, _HEARTBEAT, to, forward, know_gateway, preferred_gateway, 0
    )


def next_hop(payload: bytes, from_: int, to: int) -> bytes | None:
    """The same packet, forwarded by `from_` to `to`; a heartbeat counts the hop.

    None for a heartbeat that has reached MAX_HOPS.
    """
    creator, kind, between, count, rest = _WITHOUT_HOP.unpack(payload)
    if kind == _HEARTBEAT:
        if count >= MAX_HOPS:
            return None
        count += 1
    elif kind == ROUTE_RECORD and count < MOST_RECORDED:
        rest = rest[:count] + _BYTE[from_] + rest[count + 1 :]
        count += 1
    return _NEXT_HOP.pack(creator, from_, kind, to, between, count, rest)


def hops(payload: bytes) -> int:
    """The hop count of a PRESENT or HEARTBEAT: to its gateway, or travelled so far."""
    if payload[TYPE_AT] == _HEARTBEAT:
        return payload[_HEARTBEAT_HOPS]
    return payload[HEADER_BYTES]


EXTENSION_ROOM: Final[dict[int, int]] = {kind: len(part) for kind, part in _EXTENSIONS.items()}
"""The number of bytes after the body that a routing technique may use, for types that have any."""


def extension(payload: bytes) -> bytes:
    """The bytes after the body of a PRESENT or HEARTBEAT; zero if no technique uses them."""
    part = _EXTENSIONS[payload[TYPE_AT]]
    return payload[part.start : part.stop]


def extended(payload: bytes, extension: bytes) -> bytes:
    """The same PRESENT or HEARTBEAT with these bytes after its body.

    Raises PacketError if they do not fit.
    """
    part = _EXTENSIONS[payload[TYPE_AT]]
    at = part.start
    if len(extension) > len(part):
        raise PacketError(f"{len(extension)} extension bytes do not fit into {len(part)}")
    return payload[:at] + extension + payload[at + len(extension) :]


def frame_digest(present: bytes) -> int:
    """The digest of its creator's origin in a PRESENT; 0: it has none."""
    digest: int = _FRAME_DIGEST.unpack_from(present, _FRAME_DIGEST_AT)[0]
    return digest


def with_frame_digest(present: bytes, digest: int) -> bytes:
    return present[:_FRAME_DIGEST_AT] + _FRAME_DIGEST.pack(digest)


def order_number(order: bytes) -> int:
    """The number after the body of a MOVE_TO_LOCATION; 0: its creator wants no reply."""
    return int(_ORDER_NUMBER.unpack_from(order, _ORDER_NUMBER_AT)[0])


def with_order_number(order: bytes, number: int) -> bytes:
    end = _ORDER_NUMBER_AT + _ORDER_NUMBER.size
    return order[:_ORDER_NUMBER_AT] + _ORDER_NUMBER.pack(number) + order[end:]


def identity(payload: bytes) -> bytes:
    """The bytes that do not change while a packet is forwarded."""
    if payload[TYPE_AT] == _HEARTBEAT:
        return payload[:FROM_AT] + payload[TYPE_AT:TO_AT] + payload[FORWARD_AT:_HEARTBEAT_HOPS]
    return payload[:FROM_AT] + payload[TYPE_AT:TO_AT] + payload[FORWARD_AT:]


def is_finite(payload: bytes) -> bool:
    """Whether all floats of a packet are finite; its type is one of FLOATS."""
    numbers = FLOATS[payload[TYPE_AT]].unpack_from(payload, HEADER_BYTES)
    return math.isfinite(sum(numbers))


def _check_length(payload: bytes) -> None:
    if len(payload) != PAYLOAD_BYTES:
        raise PacketError(f"expected {PAYLOAD_BYTES} bytes, got {len(payload)}")
