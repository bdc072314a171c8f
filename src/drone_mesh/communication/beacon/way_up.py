"""WayUp: the parent that one node chooses among its neighbours, and how well that is proved.

docs/beacons.md describes the rules.
"""

from __future__ import annotations

import math
from collections import Counter
from typing import Callable, Final, Tuple

from drone_mesh.communication.beacon.neighbour import WRONG, Neighbour
from drone_mesh.communication.beacon.neighbourhood import Neighbourhood
from drone_mesh.communication.beacon.packets import (
    ANCESTORS,
    NO_ANCESTORS,
    Beacon,
    newer,
    shows_that_it_hears,
)
from drone_mesh.communication.interfaces import NO_ROUTE
from drone_mesh.communication.timing import Deadlines
from drone_mesh.drone.location import Location, metres_between

BACK: Final = 2  # sequence numbers: a new neighbour further behind the others may lead nowhere
PROVEN_S: Final = 12.0  # a router is connected for so long after its parent has heard it
STALE: Final = 5.0  # intervals: a neighbour whose number was not a new one for longer leads nowhere
NEEDS: Final = 1.05  # of the range: a link that is longer is luck, and places are rounded
ANOTHER_GATEWAY: Final = 1.5  # hops that another gateway must be nearer
UNPROVEN: Final = 32.0  # hops: any gateway that proved to be one is nearer than one that did not
TRIES: Final = 4  # heartbeats in vain to one that did not, then another one gets its chance
MOST_DOUBTS: Final = 7  # times UNPROVEN, which is less than OFFLINE
IN_VAIN: Final = 8  # hops at most, one for each question to the gateway that had no answer
PARDONED: Final = 2  # of them, where losses are usual
REMEMBERED_S: Final = 600.0  # whether the gateway answered through a neighbour
OFFLINE: Final = 256.0  # hops: any gateway with internet is nearer than one without

Rank = Tuple[float, bool, float, int]
"""Of a way up, the lowest is the best: cost in hops, not the present one, -heard_s, neighbour."""


class WayUp(Neighbourhood):
    """One node's way to a gateway. Belongs to its component's thread."""

    def __init__(
        self,
        node_id: int,
        is_gateway: bool,
        range_m: float,
        one_loss_counts: bool,
        clock: Deadlines,
        may_be_gateway: Callable[[int], bool],
    ) -> None:
        """`may_be_gateway`: as for IMeshSeals."""
        super().__init__(range_m, one_loss_counts, clock)
        self._node_id = node_id
        self._is_gateway = is_gateway
        self._may_be_gateway = may_be_gateway
        self.tried: Counter[int] = Counter()  # by gateway: heartbeats before its first proof
        self._has_internet = is_gateway
        self.gateway = node_id if is_gateway else NO_ROUTE
        self.hops = 0 if is_gateway else NO_ROUTE
        self.parent = NO_ROUTE
        self.ancestors = NO_ANCESTORS
        self._stands_on: Beacon | None = None  # the parent's, whose ancestors these are
        self.number = 0
        self.offline = False  # the preferred gateway has no internet
        self.leaves = False  # this node gave up its connection, and flies
        self._own_number = 0  # of the latest beacon as a gateway
        self.proved_s = -math.inf  # when the parent, at that time, last proved that it hears
        self.gateway_place: Location | None = None  # what the latest beacon with one said
        # By neighbour and gateway: the newest number, and when it came. A number counts only for
        # the neighbour that sent it, so a false one makes no other neighbour look old.
        self._numbers: dict[tuple[int, int], tuple[int, float]] = {}
        self._newest: dict[int, tuple[int, float]] = {}  # by gateway, of all neighbours
        # By gateway: the number on which the parent said that it has no internet, and when.
        self._offline: dict[int, tuple[int, float]] = {}
        # By neighbour: questions to the gateway through it since the last answer, and when it was.
        self._asked: dict[int, tuple[int, float]] = {}

    # What it learns ----------------------------------------------------------------------------

    def heard(self, node: int, beacon: Beacon) -> bool:
        """A beacon of a neighbour. Returns whether it is a new one."""
        is_new = super().heard(node, beacon)
        if shows_that_it_hears(beacon, self._node_id, as_child=node == self.parent):
            self._proved(self.neighbours[node])
        if beacon.gateway not in (NO_ROUTE, self._node_id):
            self._take_number(node, beacon)
            if node == self.parent:  # others speak for their own way
                if beacon.offline:
                    self._offline[beacon.gateway] = beacon.number, self.clock.now_s
                elif not self._is_offline(beacon):
                    self._offline.pop(beacon.gateway, None)
        return is_new

    def _take_number(self, node: int, beacon: Beacon) -> None:
        """Note whether a neighbour stands on a newer beacon of the gateway than before."""
        now_s, gateway, number = self.clock.now_s, beacon.gateway, beacon.number
        newest, newest_s = self._newest.get(gateway, (number - 1, -math.inf))
        ahead = newer(number, newest)
        known = self._numbers.get((node, gateway))
        if known is None:
            since_s = newest_s if ahead >= -BACK else -math.inf
            self._numbers[node, gateway] = number, now_s if ahead > 0 else since_s
        else:
            by = newer(number, known[0])
            if by > 0 or (by < -BACK and self._is_stale(node, gateway)):  # perhaps a restart
                self._numbers[node, gateway] = number, now_s
        age_s = now_s - newest_s  # mostly less than the neighbour's own interval allows
        is_old = age_s > STALE * beacon.interval_s and age_s > STALE * self._slowest_s()
        if ahead > 0 or is_old:
            self._newest[gateway] = number, now_s

    def _is_offline(self, beacon: Beacon) -> bool:
        """Whether the gateway had no internet, when it sent the number of this beacon or later."""
        known = self._offline.get(beacon.gateway) if self._offline else None
        if known is None or beacon.offline:
            return beacon.offline
        number, at_s = known
        is_recent = self.clock.now_s - at_s <= STALE * self._slowest_s()
        return newer(beacon.number, number) <= 0 and is_recent

    def is_news(self, node: int, beacon: Beacon) -> bool:
        """Whether a neighbour's beacon may change this node's way up or what it announces."""
        neighbour = self.neighbours.get(node)
        if neighbour is None or node == self.parent or not neighbour.usable or beacon.looks:
            return True
        if self.parent == NO_ROUTE and not self._has_internet:
            return True
        before = neighbour.beacon
        return (
            beacon.gateway != before.gateway
            or beacon.hops != before.hops
            or beacon.parent != before.parent
            or beacon.ancestors != before.ancestors
            or beacon.offline != before.offline
            or beacon.interval_s < before.interval_s
            or (beacon.parent == self._node_id and bool(beacon.below.new))
        )

    def took(self, node: int) -> None:
        """A neighbour acknowledged a packet of this node."""
        neighbour = self.neighbours.get(node)
        if neighbour is not None:
            self._lives(neighbour)
            self._proved(neighbour)

    def _proved(self, neighbour: Neighbour) -> None:
        neighbour.proved(self.clock.now_s)
        if neighbour.node == self.parent:
            self.proved_s = self.clock.now_s

    @property
    def is_proved(self) -> bool:
        """Whether the way up works in both directions, or ends here."""
        is_fresh = self.clock.now_s - self.proved_s <= PROVEN_S and not self.leaves
        return self.is_root or is_fresh

    @property
    def shown(self) -> tuple[int, int, bool]:
        """The gateway, the hops to it, and whether it is offline, as others may count on it."""
        if self.hops == NO_ROUTE or not self.is_proved:
            return NO_ROUTE, NO_ROUTE, False
        return self.gateway, self.hops, self.offline

    def asked(self, neighbour: int, in_vain: bool) -> None:
        """A question to the gateway went through this neighbour: it was in vain, or answered."""
        before = self.in_vain_through(neighbour) or 0
        self._asked[neighbour] = before + 1 if in_vain else 0, self.clock.now_s

    def in_vain_through(self, neighbour: int) -> int | None:
        """How many such questions had no answer since the last one; None: nobody knows."""
        vain, at_s = self._asked.get(neighbour, (0, -math.inf))
        return vain if self.clock.now_s - at_s < REMEMBERED_S else None

    # What it chooses -----------------------------------------------------------------------------

    @property
    def newest_number(self) -> int:
        """The newest number of its gateway that this node knows."""
        return self._newest.get(self.gateway, (self.number,))[0]

    def choose(self) -> bool:
        """Choose the parent; returns whether anything has changed."""
        if self._has_internet:
            return False
        before = self.gateway, self.parent, self.hops, self.offline
        best: Rank | None = None
        most, equal = math.inf, math.nan  # hops of another one that may be better
        present = self.neighbours.get(self.parent)
        if present is not None and self._leads_up(present):
            best = self._rank(present)
            most = equal = best[0]
        for neighbour in self._all():
            hops = neighbour.beacon.hops
            if hops > most or hops == equal or neighbour is present:
                continue  # most are not better, whatever the risk of their links
            if (best is None or (self._hops_through(neighbour), True) < best) and (
                self._leads_up(neighbour)
            ):
                rank = self._rank(neighbour)
                if best is None or rank < best:
                    best, most, equal = rank, rank[0], math.nan
        if self._is_gateway and (best is None or best[0] >= OFFLINE):
            self._be_root()
        elif best is None:
            self.parent = self.hops = NO_ROUTE
            self.ancestors, self._stands_on = NO_ANCESTORS, None
            self.offline = False
        else:
            parent = self.neighbours[best[-1]]
            beacon = parent.beacon
            self.parent, self.gateway = parent.node, beacon.gateway
            self.hops, self.number = beacon.hops + 1, beacon.number
            if beacon is not self._stands_on:
                self._stands_on = beacon
                self.ancestors = (beacon.parent, *beacon.ancestors)[:ANCESTORS]
            self.offline = self._is_offline(beacon)
            self.proved_s = max(self.proved_s, parent.proved_s)
        return before != (self.gateway, self.parent, self.hops, self.offline)

    def set_internet(self, works: bool) -> None:
        """At a gateway: whether it has internet. Without, it stays the root of those who have no
        other, and relays for the others.
        """
        self._has_internet = works
        if works:
            self._be_root()
        else:
            self.choose()

    @property
    def is_root(self) -> bool:
        """Whether the way to a gateway ends here."""
        return self.gateway == self._node_id

    def next_number(self) -> None:
        """A root counts its beacons."""
        self.number = self._own_number = (self._own_number + 1) % 256

    def _be_root(self) -> None:
        self.gateway, self.hops = self._node_id, 0
        self.parent, self.ancestors, self._stands_on = NO_ROUTE, NO_ANCESTORS, None
        self.number, self.offline = self._own_number, not self._has_internet

    def _leads_up(self, neighbour: Neighbour) -> bool:
        me, beacon = self._node_id, neighbour.beacon
        if beacon.gateway in (NO_ROUTE, me) or beacon.hops >= NO_ROUTE - 1:
            return False
        if beacon.parent == me or me in beacon.ancestors or not neighbour.usable:
            return False
        _number, at_s = self._numbers.get((neighbour.node, beacon.gateway), (0, -math.inf))
        is_fresh = self.clock.now_s - at_s <= STALE * beacon.interval_s  # then it is not stale
        return is_fresh or not self._is_stale(neighbour.node, beacon.gateway)

    def _is_stale(self, node: int, gateway: int) -> bool:
        _number, at_s = self._numbers.get((node, gateway), (0, -math.inf))
        return self.clock.now_s - at_s > STALE * self._slowest_s()

    def _rank(self, neighbour: Neighbour) -> Rank:
        """The lowest is the best way up: few hops over links that last; if equal, the present."""
        cost = self._hops_through(neighbour) + self.risk(neighbour)
        if self._is_offline(neighbour.beacon):
            cost += OFFLINE
        gateway = neighbour.beacon.gateway
        if not self._may_be_gateway(gateway):
            cost += UNPROVEN * min(1 + self.tried[gateway] // TRIES, MOST_DOUBTS)
        vain = self._asked and self.in_vain_through(neighbour.node)
        if vain and neighbour.node != gateway:  # it may swallow what it takes
            cost += min(IN_VAIN, max(0, vain - (0 if self.one_loss_counts else PARDONED)))
        return cost, neighbour.node != self.parent, -neighbour.heard_s, neighbour.node

    def _hops_through(self, neighbour: Neighbour) -> float:
        """What the way up through a neighbour costs at least, without its own link.

        It has as many hops as its distance needs at least, whatever the neighbour claims; one that
        tells no place, or one out of reach, counts as if it were here.
        """
        beacon, place = neighbour.beacon, self.gateway_place
        if self.gateway not in (NO_ROUTE, beacon.gateway):
            return beacon.hops + ANOTHER_GATEWAY
        if place is None or self.motion is None or self.gateway == NO_ROUTE:
            return beacon.hops
        errs = neighbour.motion is None or neighbour.apart_m > WRONG * self._range_m
        from_ = self.motion if errs or neighbour.motion is None else neighbour.motion
        needed = metres_between(from_.place, place) / (NEEDS * self._range_m)
        return max(beacon.hops, math.ceil(needed))
