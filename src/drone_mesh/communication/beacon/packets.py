"""The packets of the technique `beacon` (docs/beacons.md, "Beacons")."""

from __future__ import annotations

import math
import struct
from typing import Final, Iterable, NamedTuple, Sequence, Tuple

from drone_mesh.communication.interfaces import MAX_NODE_ID, NO_ROUTE
from drone_mesh.communication.wire.messages import HEADER_BYTES
from drone_mesh.drone.location import Location

Velocity = Tuple[float, float, float]  # m/s: north, east, up, as in a Location

ANCESTORS: Final = 3  # beyond the parent; more do not fit, fewer leave loops among moving nodes
SEQUENCE_NUMBERS: Final = 256
INTERVAL_S: Final = 0.05  # unit of an interval
_PLACE_M: Final = 0.1  # unit of a place
_WRAP: Final = 2**16
_FASTEST_M_S: Final = 50.0  # a velocity is coded by its square root, so slow ones are precise

_END: Final = b"\xff"  # of the new nodes below, and of the neighbours if they do not fill it
_AS_BITS: Final = 255  # no node's id; first in a list of nodes below: it consists of bits
_BITS_AT: Final = 2  # in such a list, behind the first id
MOST_BELOW: Final = 0x0F  # bytes for nodes below: their number is in the byte of the flags
_HAS_PLACE: Final = 0x10
_HAS_DIGEST: Final = 0x20
_HAS_GATEWAY_PLACE: Final = 0x40
_LOOKS: Final = 0x80
_LONGEST: Final = 0x7F  # in the byte of the interval
_OFFLINE: Final = 0x80
_PLACE: Final = struct.Struct("<3H3b")
_GATEWAY_PLACE: Final = struct.Struct("<3H")
_DIGEST: Final = struct.Struct("<H")
_HEAD: Final = struct.Struct(f"<BBBBBB{ANCESTORS}s")  # what follows may be absent
_GATEWAY_AT: Final = HEADER_BYTES + 2
_SEARCH = struct.Struct("<BHB")
_FOUND = struct.Struct("<B")

Units = Tuple[int, int, int]  # a place in units of _PLACE_M, modulo 65,536: within 3.2 km of here


class Motion(NamedTuple):
    """Where a node is and how it moves."""

    place: Location
    velocity: Velocity


def apart_m(one: Motion, ones_s: float, other: Motion, others_s: float) -> float:
    """From where one will be to where the other one will be, each in its own time."""
    # Without objects for places, and no method of a tuple: the most frequent question of all.
    a, b, c = one.place
    d, e, f = other.place
    u, v, w = one.velocity
    x, y, z = other.velocity
    north = a + u * ones_s - (d + x * others_s)
    east = b + v * ones_s - (e + y * others_s)
    up = c + w * ones_s - (f + z * others_s)
    return math.sqrt(north * north + east * east + up * up)


NO_LIST: Final = 255


class Below(NamedTuple):
    """Some of the nodes that a node leads to, in circular order of their ids.

    None of those between `after` and the last of `listed` is left out. So who hears a part of the
    list also learns who is no longer in it. An empty list says that there is none but the new ones.
    """

    after: int  # the last one of the part before; NO_LIST: this beacon has no room for any
    listed: tuple[int, ...]
    new: tuple[int, ...] = ()  # since the last beacon, wherever their turn is


def _list_bytes(listed: tuple[int, ...]) -> bytes:
    """The ids, or the first one and a bit for each one from there on, if that is shorter."""
    ids = bytes(listed)
    if not ids or len(ids) <= _BITS_AT + 1 + (ids[-1] - ids[0]) % 256 // 8:
        return ids
    bits = sum([1 << (node - ids[0]) % 256 for node in ids])
    return bytes((_AS_BITS, ids[0])) + bits.to_bytes((bits.bit_length() + 7) // 8, "little")


def room_below(room: int, motion: Motion | None, gateway: Location | None, digest: int) -> int:
    """How many of `room` bytes are left for nodes; negative: not even the rest of it fits."""
    used = _HEAD.size + 1
    used += 0 if motion is None else _PLACE.size
    used += _DIGEST.size if digest else 0
    used += 0 if gateway is None else _GATEWAY_PLACE.size
    return room - used


def room_near(room: int, below: Below) -> int:
    """How many neighbours fit behind these nodes below, which have `room` bytes."""
    return room - len(_list_bytes(below.listed)) - len(below.new) - len(_END)


def left_out(below: Below, nodes: Iterable[int]) -> list[int]:
    """Those of `nodes` that would be listed if they were below, and are not."""
    listed, first = below.listed, below.after + 1
    if not listed:
        return [] if below.after == NO_LIST else list(nodes)
    span, ids = (listed[-1] - first) % 256, bytes(listed)  # in which a search is fast
    return [node for node in nodes if (node - first) % 256 <= span and node not in ids]


def ids_that_fit(ids: Sequence[int], room: int) -> tuple[int, ...]:
    """The longest beginning of `ids`, in circular order, that a list of `room` bytes can hold."""
    if len(ids) <= room:
        return tuple(ids)
    as_bits = tuple([node for node in ids if (node - ids[0]) % 256 < 8 * (room - _BITS_AT)])
    return max(tuple(ids[:room]), as_bits, key=len)


def _listed(data: bytes) -> tuple[int, ...]:
    """The inverse of `_list_bytes`."""
    if len(data) <= _BITS_AT or data[0] != _AS_BITS:
        return tuple(data)
    bits = int.from_bytes(data[_BITS_AT:], "little")
    return tuple((data[1] + at) % 256 for at in range(bits.bit_length()) if bits >> at & 1)


NONE_BELOW = Below(0, ())
NOT_LISTED = Below(NO_LIST, ())


class Beacon(NamedTuple):
    """One beacon."""

    gateway: int  # the preferred one; NO_ROUTE: none
    number: int  # of the gateway's beacon on which this route stands
    hops: int
    parent: int  # next hop to the gateway
    ancestors: tuple[int, ...]  # the parent's parent and so on; NO_ROUTE: none
    interval_s: float  # until the next beacon, about
    motion: Motion | None = None
    gateway_place: Location | None = None
    digest: int = 0  # of the origin of its places; see CommonFrame
    looks: bool = False  # asks for the beacons of its neighbours
    below: Below = NONE_BELOW
    near: tuple[int, ...] = ()  # some of its neighbours
    offline: bool = False  # the gateway has no internet

    def to_body(self, room: int) -> bytes:
        """Its `room` bytes. It has to fit: see `room_below`."""
        flags = _LOOKS if self.looks else 0
        body = b""
        if self.motion is not None:
            flags |= _HAS_PLACE
            (north, east, up), (v, w, climb) = _units(self.motion.place), self.motion.velocity
            speeds = _speed_code(v), _speed_code(w), _speed_code(climb)
            body += _PLACE.pack(north, east, up, *speeds)
        if self.digest:
            flags |= _HAS_DIGEST
            body += _DIGEST.pack(self.digest)
        if self.gateway_place is not None:
            flags |= _HAS_GATEWAY_PLACE
            body += _GATEWAY_PLACE.pack(*_units(self.gateway_place))
        listed = _list_bytes(self.below.listed)
        interval = max(1, min(_LONGEST, math.ceil(self.interval_s / INTERVAL_S)))
        head = _HEAD.pack(
            flags | len(listed),
            interval | _OFFLINE if self.offline else interval,
            self.gateway,
            self.number,
            self.hops,
            self.parent,
            bytes(self.ancestors),
        )
        body += bytes((self.below.after,)) + listed + bytes(self.below.new)
        return (head + body + _END + bytes(self.near))[:room].ljust(room, _END)

    @classmethod
    def from_body(cls, body: bytes, here: Location | None) -> Beacon | None:
        """Decode the bytes of `to_body`; None if they are damaged.

        Places are the nearest to `here` that fit the bytes; without a `here` they are left out.
        """
        flags: int
        interval: int
        flags, interval, gateway, number, hops, parent, ancestors = _HEAD.unpack_from(body)
        if MAX_NODE_ID < gateway != NO_ROUTE:
            return None
        at, motion, gateway_place, digest = _HEAD.size, None, None, 0
        place_at = at
        at += _PLACE.size if flags & _HAS_PLACE else 0
        digest_at = at
        at += _DIGEST.size if flags & _HAS_DIGEST else 0
        gateway_at = at
        at += _GATEWAY_PLACE.size if flags & _HAS_GATEWAY_PLACE else 0
        if at + 1 + (flags & MOST_BELOW) > len(body):
            return None
        if flags & _HAS_PLACE and here is not None:
            north, east, up, v, w, climb = _PLACE.unpack_from(body, place_at)
            velocity = _SPEEDS[v], _SPEEDS[w], _SPEEDS[climb]
            motion = Motion(_place(north, east, up, here), velocity)
        if flags & _HAS_DIGEST:
            (digest,) = _DIGEST.unpack_from(body, digest_at)
        if flags & _HAS_GATEWAY_PLACE and here is not None:
            north, east, up = _GATEWAY_PLACE.unpack_from(body, gateway_at)
            gateway_place = _place(north, east, up, here)
        after, end = at, at + 1 + (flags & MOST_BELOW)
        listed = _listed(body[after + 1 : end])
        new, _end, rest = body[end:].partition(_END)
        below = Below(body[after], listed, tuple(new))
        if max(listed + below.new, default=0) > MAX_NODE_ID:  # announced, it would spoil lists
            return None
        near = rest.split(_END, 1)[0]
        return cls(
            gateway,
            number,
            hops,
            parent,
            tuple(ancestors),
            max(1, interval & _LONGEST) * INTERVAL_S,
            motion,
            gateway_place,
            digest,
            bool(flags & _LOOKS),
            below,
            tuple(near),
            bool(interval & _OFFLINE),
        )


class BeaconReader:
    """Decodes beacons, and quickly the same one again: in one process many nodes receive it.

    Any thread: the last one is replaced as a whole.
    """

    def __init__(self) -> None:
        self._last: tuple[bytes, Location | None, Beacon | None] = b"", None, None

    def read(self, body: bytes, here: Location | None) -> Beacon | None:
        """See `Beacon.from_body`."""
        last_body, last_here, beacon = self._last
        if body != last_body or here != last_here:
            beacon = Beacon.from_body(body, here)
            self._last = body, here, beacon
        return beacon


READER: Final = BeaconReader()


def shows_that_it_hears(beacon: Beacon, node: int, as_child: bool) -> bool:
    """Whether the sender hears `node`; of those below it, it does only if they are children."""
    if node == beacon.parent or node in beacon.near:
        return True
    return as_child and (node in beacon.below.listed or node in beacon.below.new)


def named_nodes(beacon: Beacon) -> tuple[int, ...]:
    """The nodes that the sender hears or leads to, as far as they fit this beacon."""
    return beacon.below.listed + beacon.below.new + beacon.near


def names_gateway(payload: bytes) -> bool:
    """Whether the packet is a beacon of a connected node."""
    return payload[_GATEWAY_AT] <= MAX_NODE_ID


def newer(number: int, than: int) -> int:
    """By how much a sequence number is newer, -128..127 (RFC 1982)."""
    return (number - than + 128) % SEQUENCE_NUMBERS - 128


class Search(NamedTuple):
    """A search for a node; every node repeats it once."""

    node: int
    number: int  # of the search
    hops_left: int

    def to_body(self) -> bytes:
        return bytes(_SEARCH.pack(*self))

    @classmethod
    def from_body(cls, body: bytes) -> Search:
        return cls(*_SEARCH.unpack_from(body))


class Found(NamedTuple):
    """Its creator, and every node that forwards it, leads to `node`."""

    node: int

    def to_body(self) -> bytes:
        return bytes(_FOUND.pack(*self))

    @classmethod
    def from_body(cls, body: bytes) -> Found:
        return cls(*_FOUND.unpack_from(body))


NO_ANCESTORS: tuple[int, ...] = (NO_ROUTE,) * ANCESTORS


def _units(place: Location) -> Units:
    latitude, longitude, height = place
    return _unit(latitude), _unit(longitude), _unit(height)


def _unit(metres: float) -> int:
    return round(metres / _PLACE_M) % _WRAP


def _place(north: int, east: int, up: int, here: Location) -> Location:
    latitude, longitude, height = here
    return Location(_nearest(north, latitude), _nearest(east, longitude), _nearest(up, height))


def _nearest(unit: int, near_m: float) -> float:
    near = math.floor(near_m / _PLACE_M)
    off = (unit - near + _WRAP // 2) % _WRAP - _WRAP // 2
    return (near + off) * _PLACE_M


def _speed_code(speed_m_s: float) -> int:
    code = min(127, round(127 * math.sqrt(abs(speed_m_s) / _FASTEST_M_S)))
    return code if speed_m_s >= 0 else -code


def _speed(code: int) -> float:
    return math.copysign(_FASTEST_M_S * (code / 127) ** 2, code)


_SPEEDS: Final = [_speed(code) for code in (*range(128), *range(-128, 0))]  # by code
