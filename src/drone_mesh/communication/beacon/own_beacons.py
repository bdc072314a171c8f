"""What the next beacon of this node says: where it is, how it moves, and whom it leads to.

docs/beacons.md, "Beacons".
"""

from __future__ import annotations

import bisect
import math
from dataclasses import dataclass
from typing import Callable, Final, Iterable

from drone_mesh.communication.beacon.packets import (
    MOST_BELOW,
    NOT_LISTED,
    Beacon,
    Below,
    Motion,
    apart_m,
    ids_that_fit,
    room_below,
    room_near,
)
from drone_mesh.communication.beacon.routes import BeaconRoutes
from drone_mesh.communication.control.places import CommonFrame
from drone_mesh.communication.interfaces import NO_ROUTE, IMeshSeals
from drone_mesh.communication.wire import messages
from drone_mesh.communication.wire.packet_types import MessageType
from drone_mesh.drone.location import Location, metres_between

OVER_S: Final = 2.0  # noise of a receiver and turns of a drone cancel out
TURN_S: Final = 0.5  # only so long before a turn is noticed count samples for the new velocity
STANDS_S: Final = 10.0  # a drone that has not moved for this long stands
REGION_M: Final = 256.0  # far less than the distance up to which a beacon tells its place
AGAIN_S: Final = 0.1  # a receiver for satellites gives ten positions per second


class OwnMotion:
    """Samples the position of one node whenever it is asked."""

    def __init__(self, locate: Callable[[], Location | None], step_m: float) -> None:
        """A node that moved less than `step_m` counts as standing: positions have errors."""
        self._locate = locate
        self._step_m = step_m
        self._anchor: Location | None = None
        self.region: Location | None = None  # about where it is: the same for most nodes near it
        self._moved_s = -math.inf
        self._samples: list[tuple[float, Location]] = []
        self._motion: Motion | None = None
        self._asked_s = -AGAIN_S
        self._least_s = OVER_S / 2

    def stands(self, now_s: float) -> bool:
        """Whether it is at rest, as far as it knows its place."""
        return now_s - self._moved_s >= STANDS_S

    def has_turned(self, now_s: float) -> None:
        """Forget the velocity: the node is not where that led."""
        self._least_s = TURN_S
        while self._samples and now_s - self._samples[0][0] > TURN_S:
            self._samples.pop(0)

    def at(self, now_s: float) -> Motion | None:
        """Position and velocity now; None while the position is unknown."""
        if now_s - self._asked_s < AGAIN_S:
            return self._motion
        self._asked_s = now_s
        place = self._locate()
        if place is None:
            self._samples.clear()
            self._motion = self.region = None
            return None
        if self._anchor is None or metres_between(self._anchor, place) > self._step_m:
            self._moved_s = -math.inf if self._anchor is None else now_s
            self._anchor = place
            self.region = None
        if self.region is None:
            self.region = Location(*(REGION_M * round(value / REGION_M) for value in place))
        samples = self._samples
        samples.append((now_s, place))
        while len(samples) > 1 and now_s - samples[1][0] >= OVER_S:
            samples.pop(0)
        since_s, before = samples[0]
        seconds = max(now_s - since_s, self._least_s)  # a short time would exaggerate the noise
        self._motion = Motion(
            place,
            (
                (place.latitude - before.latitude) / seconds,
                (place.longitude - before.longitude) / seconds,
                (place.height - before.height) / seconds,
            ),
        )
        return self._motion


LINGERS: Final = 1.0  # intervals: a node that has left is still announced for so long


class NodesBelow:
    """The nodes below one node, as its children announce them, and its own announcements."""

    def __init__(self, node_id: int, routes: BeaconRoutes) -> None:
        self._node_id, self._routes = node_id, routes
        self._known_s: dict[int, float] = {}  # and when they were below it last
        self._announced: set[int] = set()
        self._new: set[int] = set()  # since this node has announced it last
        self._announced_last = self._shown_last = 0

    def heard(self, node: int, beacon: Beacon) -> None:
        """A neighbour's beacon, of which the routes do not know yet."""
        if beacon.parent == self._node_id:
            known = self._routes.neighbours.get(node)
            if known is None or known.beacon.parent != self._node_id:
                self._new.add(node)
            self._new.update(beacon.below.new)

    def known_s(self, node: int) -> float:
        """When `node` was below this one last, or -infinity. Any thread."""
        return self._known_s.get(node, -math.inf)

    def ids(self) -> set[int]:
        """The nodes that this one leads to.

        A node that has left is mostly still near, and its new way is not known further up yet.
        """
        routes, known_s = self._routes, self._known_s
        now_s, period_s = routes.now_s, 0.0
        for child in routes.neighbours.values():
            period_s = max(period_s, child.beacon.interval_s)
            if child.beacon.parent == self._node_id:
                known_s[child.node] = now_s
                known_s.update(dict.fromkeys(child.announced_s, now_s))
        for node in (self._node_id, *routes.ancestors, routes.parent):
            known_s.pop(node, None)
        for node in [n for n, at_s in known_s.items() if now_s - at_s > LINGERS * period_s]:
            del known_s[node]
        return set(known_s)

    def to_announce(self, most: int) -> Below:
        """The next part of them, and those that came to it, in at most so many bytes."""
        below, after = self.ids(), self._announced_last
        if most < 1:
            return NOT_LISTED
        self._announced &= below
        self._new = self._new & below | below - self._announced
        turn = _from(after + 1, below)
        new = sorted(self._new)[: max(0, most - 1)]
        listed = ids_that_fit(turn, most)
        if new and len(new) >= len(self._new.intersection(listed)):
            turn = [node for node in turn if node not in new]
            listed = ids_that_fit(turn, most - len(new))
        else:  # none, or many at once, such as a whole subtree
            new = []
        self._new.difference_update(new, listed)
        if listed:
            self._announced_last = listed[-1]
        if len(listed) == len(turn):
            after = self._announced_last  # once round
        self._announced.update(listed, new)
        return Below(after, listed, tuple(new))

    @property
    def has_news(self) -> bool:
        """Whether a node has come from elsewhere and is not announced yet."""
        return bool(self._new)

    def to_show(self, most: int) -> tuple[int, ...]:
        """The next part of the neighbours with whom the link will last, at most so many."""
        routes, neighbours = self._routes, self._routes.neighbours
        shown: list[int] = []
        for node in _from(self._shown_last + 1, neighbours):
            if len(shown) >= most:
                break
            if neighbours[node].usable and not routes.risk(neighbours[node]):
                shown.append(node)
                self._shown_last = node
        return tuple(shown)


def _from(first: int, nodes: Iterable[int]) -> list[int]:
    """The ids in circular order, from this one on."""
    ids = sorted(nodes)
    at = bisect.bisect_left(ids, first)
    return ids[at:] + ids[:at]


GATEWAY_PLACE_EVERY: Final = 4  # beacons: one of so many carries the gateway's place
DIGEST_EVERY: Final = 4  # beacons: one of so many carries the digest of the origin
PLACE_EVERY: Final = 2  # beacons: if its lists are long, one of so many carries its own place
PLACE_AT_REST_EVERY: Final = 4  # a drone that stands is where the last one said
SEALED_ROOM: Final = 20  # bytes of a beacon with a seal


@dataclass(eq=False)
class OwnBeacons:
    """Composes the beacons of one node: what does not fit one takes turns."""

    _seals: IMeshSeals
    _frame: CommonFrame
    _routes: BeaconRoutes
    _below: NodesBelow
    _motion: OwnMotion
    _step_m: float  # a node so near to where it is expected is there, and so is a gateway

    def __post_init__(self) -> None:
        self.room = messages.BODY_BYTES - self._seals.reserved_bytes(MessageType.BEACON)
        self.asks = True  # whether the next one asks for those of the neighbours
        self._told_place: Location | None = None  # what this node's beacons have said
        self._sent = 0
        self._shown: tuple[float, Motion] | None = None  # what the others expect of this drone

    def next_body(self, interval_s: float) -> bytes:
        """Its `room` bytes, now that it is due; the one after it comes in about `interval_s`."""
        routes = self._routes
        self._sent += 1
        if routes.is_root:
            routes.next_number()
        gateway, hops, offline = routes.shown
        is_sealed = self.room <= SEALED_ROOM  # a seal leaves room for less: some parts take turns
        has_digest = self.asks or self._sent % DIGEST_EVERY == (0 if is_sealed else 1)
        digest, looks = self._frame.digest if has_digest else 0, self.asks or hops == NO_ROUTE
        self.asks = False
        motion: Motion | None = routes.motion
        gateway_place, below = self._next_gateway_place(), self._below
        room = room_below(self.room, motion, gateway_place, digest)
        every = PLACE_AT_REST_EVERY if self._motion.stands(routes.now_s) else PLACE_EVERY
        yields = is_sealed and self._sent % every != 1
        if room < 0 or (yields and min(MOST_BELOW, room) < len(below.ids())):
            motion = None
            room = room_below(self.room, motion, gateway_place, digest)
        announced = below.to_announce(min(MOST_BELOW, room))
        beacon = Beacon(
            gateway,
            routes.number,
            hops,
            routes.parent,
            routes.ancestors,
            interval_s,
            motion,
            gateway_place,
            digest,
            looks,
            announced,
            below.to_show(room_near(room, announced)),
            offline,
        )
        if motion is not None:
            self._shown = routes.now_s, motion
        return beacon.to_body(self.room)

    def mislead(self, motion: Motion) -> bool:
        """Whether the others expect this drone elsewhere, after the latest; reported once."""
        if self._shown is None:
            return False
        shown_s, shown = self._shown
        if apart_m(shown, self._routes.now_s - shown_s, motion, 0.0) <= self._step_m:
            return False
        self._shown = None
        return True

    def _next_gateway_place(self) -> Location | None:
        """The gateway's place, if it is this beacon's turn to spread it."""
        place, told = self._routes.gateway_place, self._told_place
        if self._routes.is_root or place is None:
            return None
        every = GATEWAY_PLACE_EVERY
        if told is None or metres_between(told, place) > self._step_m:
            every = 2 if self.room <= SEALED_ROOM else 1  # with a seal, instead of its own
        if self._sent % every:
            return None
        self._told_place = place
        return place
