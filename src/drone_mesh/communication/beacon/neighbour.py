"""What the beacons of one neighbour have told a node, and how many of them its link loses."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

from drone_mesh.communication.beacon.packets import Beacon, Motion, left_out
from drone_mesh.drone.location import Location, metres_between

WEIGHT: Final = 0.1  # of one beacon in the moving mean
LEAST: Final = 0.05  # of the mean
STEP: Final = 0.5  # hops: small differences must not change the parent
MOST: Final = 3.0  # hops: of the loss of a link, whatever it loses
FAR: Final = 0.15  # assumed of a link that is longer than it should reach, until it shows more
WRONG: Final = 1.15  # of the range: a place further away errs, or fading adds to the power
LUCKY: Final = 2.3  # of the range: fading that adds 10 dB reaches so far; beyond it a place errs
STOOD: Final = 0.05  # of the range: what both ends moved between two beacons, at most
FORGOTTEN: Final = 20.0  # intervals: after such a silence a neighbour is a new one


class _Link:
    """The link to one neighbour, as of its last beacon."""

    __slots__ = ("heard_s", "interval_s", "kept", "own", "place")

    def __init__(self, own: Location, place: Location) -> None:
        self.kept = 1.0  # the share of beacons that passed
        self.heard_s, self.interval_s = -math.inf, 1.0
        self.own, self.place = own, place  # where this node was, and that one


class Losses:
    """The share of beacons that pass on the links of one node, also of neighbours that fell silent.

    Otherwise a link that passes one beacon in ten would be new, and look perfect, each time. Only
    between drones that stand: what a link lost elsewhere says nothing.
    """

    def __init__(self, range_m: float) -> None:
        self._range_m = range_m
        self._links: dict[int, _Link] = {}  # by neighbour

    def heard(
        self, node: int, interval_s: float, own: Location, place: Location, now_s: float
    ) -> float:
        """A beacon came; those that were due before it were lost. Returns the cost in hops."""
        link = self._links.get(node)
        if link is None:
            link = self._links[node] = _Link(own, place)
        kept, intervals = link.kept, (now_s - link.heard_s) / link.interval_s
        before, before_there = link.own, link.place
        link.heard_s, link.interval_s, link.own, link.place = now_s, interval_s, own, place
        if kept == 1.0 and intervals < 1.5:
            return 0.0  # wherever it is
        is_known = intervals <= FORGOTTEN + 0.5
        moved_m = metres_between(own, before) + metres_between(place, before_there)
        if is_known and moved_m <= STOOD * self._range_m:
            kept = kept * (1.0 - WEIGHT) ** max(1, round(intervals)) + WEIGHT
        elif not WRONG < metres_between(own, place) / self._range_m <= LUCKY:
            kept = 1.0
        elif not is_known:  # one place may be wrong
            kept = FAR
        link.kept = kept = max(LEAST, kept)
        again = 1.0 / kept - 1.0  # further frames, as expected: De Couto et al. 2003
        return min(MOST, again // STEP * STEP)


FRESH: Final = 2.5  # intervals: a neighbour that was silent for longer is none
FRESH_IF_LOSSY: Final = 3.5  # where beacons collide: the loss of two in a row is usual
MOST_VAIN: Final = 3  # nodes with which it brought no contact; then it counts as one that swallows
MOST_REFUSED: Final = 3  # packets that it did not take, since it last proved that it hears
REFUSED_S: Final = 3.0  # within which; a burst of losses is shorter


@dataclass(eq=False)
class Neighbour:
    """What is known of one neighbour."""

    node: int
    beacon: Beacon
    fresh: float  # intervals, see FRESH
    heard_s: float = -math.inf
    alive_s: float = -math.inf
    failed_s: float = -math.inf
    doubted_s: float = -math.inf  # when it did not take a packet
    proved_s: float = -math.inf  # when it showed that it hears this node
    refused: int = 0  # packets that it did not take since
    refuses_s: float = math.inf  # the first of them
    deaf: bool = False  # to this node: the link works one way only
    until_s: float = -math.inf  # it counts as a neighbour without a further sign of life
    motion: Motion | None = None  # the last one that it reported
    reported_s: float = -math.inf
    at_rest: Location | None = None  # where to look for it when it is lost, not up in the air
    apart_m: float = 0.0  # then
    loss: float = 0.0  # of its link, in hops

    def __post_init__(self) -> None:
        self.announced_s: dict[int, float] = {}  # the nodes below it, and since when
        self.listed_s: dict[int, float] = {}  # and when it listed them last
        # Nodes that did not answer what this one took for them, since a packet of another came here
        self.vain: set[int] = set()
        self.near_s: dict[int, float] = {}  # its own neighbours, and when it showed them

    @property
    def usable(self) -> bool:
        """Whether it was alive since it failed, and hears this node."""
        return self.alive_s > self.failed_s and not self.deaf

    @property
    def swallows(self) -> bool:
        """Whether it seems to lead nowhere, whatever it lists."""
        return len(self.vain) >= MOST_VAIN

    def heard(self, beacon: Beacon, own: Motion | None, now_s: float) -> None:
        """Its beacon arrived, while this node was where `own` says."""
        self.beacon, self.heard_s = beacon, now_s
        if beacon.motion is not None:
            self.motion, self.reported_s = beacon.motion, now_s
            self.apart_m = 0.0 if own is None else metres_between(own.place, beacon.motion.place)
        near_s, announced_s, listed_s = self.near_s, self.announced_s, self.listed_s
        for node in beacon.near:
            near_s[node] = now_s
        _after, listed, new = below = beacon.below
        if announced_s:
            for node in left_out(below, announced_s):
                del announced_s[node]
        for node in listed:
            announced_s.setdefault(node, now_s)
            listed_s[node] = now_s
        for node in new:
            announced_s[node] = listed_s[node] = now_s

    def proved(self, now_s: float) -> None:
        """Note that the link works both ways: it took a packet of this node, or names it."""
        self.proved_s = now_s
        self.hears_perhaps()

    def hears_perhaps(self) -> None:
        """Forget the packets that it did not take: it may hear this node again."""
        self.refused, self.refuses_s, self.deaf = 0, math.inf, False

    def refuses(self, now_s: float) -> None:
        """Count a packet that it did not take; after several it is deaf to this node."""
        self.refused += 1
        self.refuses_s = min(self.refuses_s, now_s)
        is_burst = now_s - self.refuses_s < REFUSED_S
        self.deaf = self.deaf or (self.refused >= MOST_REFUSED and not is_burst)

    def alive(self, now_s: float) -> None:
        """Note a sign of life."""
        self.alive_s = now_s
        self.until_s = now_s + self.fresh * self.beacon.interval_s
