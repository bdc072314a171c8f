"""The packets of users' data: types and bodies (docs/wire.md, "Data").

No other module knows an offset in them. A message is cut into fragments. The type of a packet says
which fragment it carries, so that one byte of the body, the message's id, is all the header that
most fragments have.
"""

from __future__ import annotations

import binascii
import math
import struct
from typing import Callable, NamedTuple

from drone_mesh.communication.wire.messages import (
    BODY_BYTES,
    QUESTION,
    ROUTE_RECORD,
    ROUTE_RECORD_AT,
)
from drone_mesh.errors import MessageRefused, PacketError

MAX_MESSAGE_BYTES = 1024
MAX_DATA_PORT = 255  # one byte
MESSAGE_TAG_BYTES = 6  # after the payload of a message in a mesh with a key
FRAGMENTS = range(128, 192)  # type of the fragment with index 0, 1, ...
ACK = 192  # the fragments of a message that its creator has
POLL = QUESTION  # asks for an ACK, and ends a train
NO_ANSWER = 0  # nonce of a POLL that only ends a train
ECHO = ROUTE_RECORD  # asks for an ECHO_ANSWER; each node that forwards it adds its id
ECHO_ANSWER = 195
LEAST_ROOM = 20  # bytes of a body; with fewer, a long message would need more than 64 fragments

_HEAD = struct.Struct("<BHBHHH")
_PLACE = struct.Struct("<HBH")
_LENGTH = struct.Struct("<H")
_LENGTH_BITS = 11
_RELIABLE = 1 << _LENGTH_BITS
_BEHIND_SHIFT = _LENGTH_BITS + 1
MOST_BEHIND = (1 << 16 - _BEHIND_SHIFT) - 1
_ACK = struct.Struct("<HBBQBI")
_POLL = struct.Struct("<HBBH")
_TOKEN = struct.Struct("<H")

SendPacket = Callable[[int, int, bytes], bool]
"""Sends a packet with a type and a body to a node; False: it could not be sent."""


def check_size(payload: bytes) -> None:
    """Raise MessageRefused if a user's message is too large."""
    if len(payload) > MAX_MESSAGE_BYTES:
        raise MessageRefused(
            f"the message is too large: {len(payload)} bytes, "
            f"at most {MAX_MESSAGE_BYTES} are possible"
        )


class Head(NamedTuple):
    """The header of a message, in its first fragment."""

    number: int  # 0..255: number of this message among those for the same destination
    session: int  # 0..65535: changes with each restart of the sender
    port: int  # 0..MAX_DATA_PORT
    length: int  # bytes of the whole payload
    reliable: bool
    behind: int  # distance in the order back to the oldest message that may still arrive
    order: int  # 0..65535: place among the messages of this port and this kind of delivery
    checksum: int  # of the whole message

    @property
    def fingerprint(self) -> tuple[int, ...]:
        """The parts that are equal in each transmission of the same message."""
        return (*self[:5], *self[6:])


class Whole(NamedTuple):
    """A complete message."""

    head: Head
    payload: bytes
    fragments: int = 1


class Ack(NamedTuple):
    """The fragments and messages that a receiver has."""

    session: int  # of the sender whose messages these are
    nonce: int  # that of the POLL that it answers; 0: none
    number: int  # of a message
    has: int  # bit n: fragment n of that message; all ones: all
    newest: int  # number of a message
    done: int  # bit n, 0..31: message `newest` - n is complete


class Poll(NamedTuple):
    """Requests an ACK for a message."""

    session: int
    nonce: int  # 1..255, different each time, so that no two have the same bytes; or NO_ANSWER
    number: int
    checksum: int = 0  # of that message: its number comes again after 256


COMPLETE = (1 << len(FRAGMENTS)) - 1  # as Ack.has
DONE_BITS = 32  # of Ack.done


def place_of(session: int, port: int, order: int) -> bytes:
    """Identifies a message among the others of its sender."""
    return _PLACE.pack(session, port, order)


def checksum(session: int, port: int, order: int, payload: bytes) -> int:
    """CRC-16/CCITT over the place, the length and the payload of a message."""
    made = place_of(session, port, order) + _LENGTH.pack(len(payload)) + payload
    return binascii.crc_hqx(made, 0xFFFF)


def count_of(length: int, room: int) -> int:
    """The number of fragments of a payload of `length` bytes, with bodies of `room` bytes."""
    return 1 + math.ceil(max(0, length - (room - _HEAD.size)) / (room - 1))


def first_body(head: Head, payload: bytes, room: int) -> bytes:
    """The body of fragment 0."""
    meta = head.length | _RELIABLE * head.reliable | head.behind << _BEHIND_SHIFT
    packed = _HEAD.pack(head.number, head.session, head.port, meta, head.order, head.checksum)
    return packed + payload[: room - _HEAD.size]


def further_body(number: int, index: int, payload: bytes, room: int) -> bytes:
    """The body of fragment `index`, 1 or more."""
    start = room - _HEAD.size + (index - 1) * (room - 1)
    return bytes((number,)) + payload[start : start + room - 1]


def head_of(body: bytes) -> Head:
    """The header in the body of fragment 0. Raises PacketError for an impossible length."""
    number, session, port, meta, order, check = _HEAD.unpack_from(body)
    length = meta & (1 << _LENGTH_BITS) - 1
    if length > MAX_MESSAGE_BYTES + MESSAGE_TAG_BYTES:
        raise PacketError(f"a message of {length} bytes: at most {MAX_MESSAGE_BYTES} are allowed")
    return Head(
        number, session, port, length, bool(meta & _RELIABLE), meta >> _BEHIND_SHIFT, order, check
    )


def joined(bodies: list[bytes], length: int, room: int) -> bytes:
    """The payload from the bodies of all fragments, in order."""
    chunks = [bodies[0][_HEAD.size : room], *(body[1:room] for body in bodies[1:])]
    return b"".join(chunks)[:length]


def ack_body(ack: Ack) -> bytes:
    return _ACK.pack(*ack)


def ack_of(body: bytes) -> Ack:
    return Ack(*_ACK.unpack_from(body))


def untagged(body: bytes) -> bytes:
    """The body of an ACK without the tag that follows it in a mesh with a key."""
    return body[: _ACK.size]


def poll_body(poll: Poll) -> bytes:
    return _POLL.pack(*poll)


def poll_of(body: bytes) -> Poll:
    return Poll(*_POLL.unpack_from(body))


# Offset in the body of an ECHO: the number of nodes that forwarded it, then one id byte for each.
_ROUTE_AT = ROUTE_RECORD_AT - (32 - BODY_BYTES)


def echo_body(token: int, route: tuple[int, ...] = (), room: int = BODY_BYTES) -> bytes:
    """The body of an ECHO, or of the answer to one that came along `route`."""
    route = route[: room - _ROUTE_AT - 1]
    return _TOKEN.pack(token) + bytes((len(route), *route))


def echo_of(body: bytes) -> tuple[int, tuple[int, ...]]:
    """Token, and the nodes that forwarded the ECHO, as far as there was room."""
    (token,) = _TOKEN.unpack_from(body)
    return token, tuple(body[_ROUTE_AT + 1 : _ROUTE_AT + 1 + body[_ROUTE_AT]])
