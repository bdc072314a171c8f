"""BeaconRoutes: the neighbours of one node, its parent, and its ways to the others.

docs/beacons.md, "Beacons", describes the rules.
"""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass
from operator import itemgetter
from typing import Callable, Final, Iterator, NamedTuple, Tuple

from drone_mesh.communication.beacon.disputes import Disputes
from drone_mesh.communication.beacon.neighbour import (
    FRESH,
    FRESH_IF_LOSSY,
    WRONG,
    Losses,
    Neighbour,
)
from drone_mesh.communication.beacon.packets import (
    ANCESTORS,
    NO_ANCESTORS,
    Beacon,
    Motion,
    apart_m,
    newer,
    shows_that_it_hears,
)
from drone_mesh.communication.control.delivery import IRoutes
from drone_mesh.communication.interfaces import NO_ROUTE
from drone_mesh.communication.neighbours import HeardPlace
from drone_mesh.communication.timing import Deadlines
from drone_mesh.drone.location import Location, metres_between

DUE: Final = 1.2  # intervals, with their jitter: until then a neighbour's next beacon is not late
BACK: Final = 2  # sequence numbers: a new neighbour further behind the others may lead nowhere
PROVEN_S: Final = 12.0  # a router is connected for so long after its parent has heard it
STALE: Final = 5.0  # intervals: a neighbour whose number was not a new one for longer leads nowhere
REACH: Final = 0.97  # of the range: two nodes further apart are expected to lose each other
NEEDS: Final = 1.05  # of the range: a link that is longer is luck, and places are rounded
LEAVES: Final = 1.0  # hops that a detour may cost around a link that will break
GONE: Final = 3.0  # or around one that should have
ANOTHER_GATEWAY: Final = 1.5  # hops that another gateway must be nearer
UNPROVEN: Final = 32.0  # hops: any gateway that proved to be one is nearer than one that did not
TRIES: Final = 4  # heartbeats in vain to one that did not, then another one gets its chance
MOST_DOUBTS: Final = 7  # times UNPROVEN, which is less than OFFLINE
IN_VAIN: Final = 8  # hops at most, one for each question to the gateway that had no answer
PARDONED: Final = 2  # of them, where losses are usual
REMEMBERED_S: Final = 600.0  # whether the gateway answered through a neighbour
OFFLINE: Final = 256.0  # hops: any gateway with internet is nearer than one without
SEEN_S: Final = 10.0  # an older place of a node does not tell the way to it
NEAR: Final = 2.0  # intervals: an older report that a neighbour hears a node shows no way to it
SHOWN_S: Final = 20.0  # beacons with little room show all neighbours of their sender in this time
HINT_S: Final = 3.0  # a packet that came from a node shows the way to it for this long

Rank = Tuple[float, bool, float, int]
"""Of a way up, the lowest is the best: cost in hops, not the present one, -heard_s, neighbour."""


class Way(NamedTuple):
    """A neighbour that may lead to a node, and when it showed that."""

    neighbour: int
    shown_s: float


@dataclass(eq=False)
class BeaconRoutes(IRoutes):
    """All that one node knows about the others. Belongs to its component's thread."""

    _node_id: int
    _is_gateway: bool
    _range_m: float
    _place_of: Callable[[int], HeardPlace | None]  # where a node was seen last
    one_loss_counts: bool  # see Policy
    clock: Deadlines
    _may_be_gateway: Callable[[int], bool] = lambda _node: True  # as for IMeshSeals

    def __post_init__(self) -> None:
        self.tried: Counter[int] = Counter()  # by gateway: heartbeats before its first proof
        self._has_internet = self._is_gateway
        self.neighbours: dict[int, Neighbour] = {}
        self.gateway = self._node_id if self._is_gateway else NO_ROUTE
        self.hops = 0 if self._is_gateway else NO_ROUTE
        self.parent = NO_ROUTE
        self.ancestors = NO_ANCESTORS
        self._stands_on: Beacon | None = None  # the parent's, whose ancestors these are
        self.number = 0
        self.offline = False  # the preferred gateway has no internet
        self.leaves = False  # this node gave up its connection, and flies
        self._own_number = 0  # of the latest beacon as a gateway
        self.proved_s = -math.inf  # when the parent, at that time, last proved that it hears
        self.motion: Motion | None = None  # this node's own
        self.gateway_place: Location | None = None  # what the latest beacon with one said
        # By neighbour and gateway: the newest number, and when it came. A number counts only for
        # the neighbour that sent it, so a false one makes no other neighbour look old.
        self._numbers: dict[tuple[int, int], tuple[int, float]] = {}
        self._newest: dict[int, tuple[int, float]] = {}  # by gateway, of all neighbours
        # By gateway: the number on which the parent said that it has no internet, and when.
        self._offline: dict[int, tuple[int, float]] = {}
        self._hints: dict[int, tuple[int, float]] = {}  # by node: a neighbour that led to it, when
        self._ends_s = math.inf  # no neighbour will have been silent for too long before
        # By neighbour: questions to the gateway through it since the last answer, and when it was.
        self._asked: dict[int, tuple[int, float]] = {}
        self._losses = Losses(self._range_m)
        self._disputes = Disputes()
        self._fresh = FRESH if self.one_loss_counts else FRESH_IF_LOSSY

    @property
    def now_s(self) -> float:
        """The time of the component's latest call."""
        return self.clock.now_s

    # What it learns ----------------------------------------------------------------------------

    def heard(self, node: int, beacon: Beacon) -> bool:
        """A beacon of a neighbour. Returns whether it is a new one."""
        neighbour = self.neighbours.get(node)
        is_new = neighbour is None
        if neighbour is None:
            neighbour = Neighbour(node, beacon, self._fresh)
            self.neighbours[node] = neighbour
        neighbour.heard(beacon, self.motion, self.clock.now_s)
        self._lives(neighbour)
        if beacon.parent == self._node_id and neighbour.announced_s:
            self._compare(neighbour)
        if shows_that_it_hears(beacon, self._node_id, as_child=node == self.parent):
            self._proved(neighbour)
        if self.motion is not None and neighbour.motion is not None:  # maybe of an earlier beacon
            neighbour.loss = self._losses.heard(
                node, beacon.interval_s, self.motion.place, neighbour.motion.place, self.clock.now_s
            )
        if beacon.gateway not in (NO_ROUTE, self._node_id):
            self._take_number(node, beacon)
            if node == self.parent:  # others speak for their own way
                if beacon.offline:
                    self._offline[beacon.gateway] = beacon.number, self.clock.now_s
                elif not self._is_offline(beacon):
                    self._offline.pop(beacon.gateway, None)
        return is_new

    def _compare(self, child: Neighbour) -> None:
        """Compare what a child has listed with what the other children list."""
        settles_s = STALE * self._slowest_s()
        for other in self.neighbours.values():
            if other.beacon.parent == self._node_id and other is not child:
                self._disputes.compare(child, other, settles_s, self.clock.now_s)

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

    def alive(self, node: int) -> None:
        """A sign of life of a node: a packet of it, or an acknowledgement."""
        neighbour = self.neighbours.get(node)
        if neighbour is not None:
            self._lives(neighbour)

    def _lives(self, neighbour: Neighbour) -> None:
        neighbour.alive(self.clock.now_s)
        self._ends_s = min(self._ends_s, neighbour.until_s)

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

    def failed(self, node: int) -> bool:
        """A neighbour did not take a packet. Where losses are usual, one says little.

        Returns whether it is now known to be deaf to this node.
        """
        neighbour, now_s = self.neighbours.get(node), self.clock.now_s
        if neighbour is None:
            return False
        was_deaf = neighbour.deaf
        neighbour.refuses(now_s)
        is_due = now_s - neighbour.alive_s <= DUE * neighbour.beacon.interval_s
        if self.one_loss_counts or not is_due or neighbour.doubted_s > neighbour.alive_s:
            neighbour.failed_s = now_s
        neighbour.doubted_s = now_s
        return neighbour.deaf and not was_deaf

    def leads_not_to(self, node: int, neighbour: int) -> None:
        """A neighbour returned a packet for `node`."""
        known = self.neighbours.get(neighbour)
        if known is not None:
            known.announced_s.pop(node, None)

    def led_to(self, node: int, neighbour: int) -> None:
        """A packet of `node` came through this neighbour."""
        self._hints[node] = neighbour, self.clock.now_s
        known = self.neighbours.get(neighbour)
        if known is not None and known.vain:
            known.vain.clear()

    def in_vain(self, node: int, neighbour: int) -> None:
        """A neighbour took a question for `node`, which has not been heard since."""
        known = self.neighbours.get(neighbour)
        if known is not None and neighbour != node:
            known.vain.add(node)

    def asked(self, neighbour: int, in_vain: bool) -> None:
        """A question to the gateway went through this neighbour: it was in vain, or answered."""
        before = self.in_vain_through(neighbour) or 0
        self._asked[neighbour] = before + 1 if in_vain else 0, self.clock.now_s

    def in_vain_through(self, neighbour: int) -> int | None:
        """How many such questions had no answer since the last one; None: nobody knows."""
        vain, at_s = self._asked.get(neighbour, (0, -math.inf))
        return vain if self.clock.now_s - at_s < REMEMBERED_S else None

    def led_s(self, node: int) -> float:
        """When a packet of this node came last over a relay. Any thread."""
        _neighbour, at_s = self._hints.get(node, (NO_ROUTE, -math.inf))
        return at_s

    def expired(self) -> list[int]:
        """Forget neighbours that were silent for too long, and return them."""
        if self.clock.now_s <= self.first_end_s(before_s=self.clock.now_s):
            return []
        old = [n.node for n in self.neighbours.values() if self.clock.now_s > n.until_s]
        for node in old:
            del self.neighbours[node]
        return old

    def first_end_s(self, before_s: float) -> float:
        """When the first neighbour will have been silent for too long, if before `before_s`.

        Otherwise a time that is not before it: most beacons ask, and few neighbours end.
        """
        if self._ends_s < before_s:
            self._ends_s = math.inf
            for neighbour in self.neighbours.values():
                self._ends_s = min(self._ends_s, neighbour.until_s)
        return self._ends_s

    # The way up --------------------------------------------------------------------------------

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

    def _slowest_s(self) -> float:
        return max([n.beacon.interval_s for n in self._all()], default=0.0)

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

    def risk(self, neighbour: Neighbour) -> float:
        """What losses on the link to a neighbour, or its expected end (Su et al. 2001), cost."""
        own, other, loss = self.motion, neighbour.motion, neighbour.loss
        if own is None or other is None or neighbour.apart_m > WRONG * self._range_m:
            return loss
        reach_m, age_s = REACH * self._range_m, self.clock.now_s - neighbour.reported_s
        if apart_m(own, 0.0, other, age_s) > reach_m:
            return max(loss, GONE)
        soon_s = neighbour.beacon.interval_s
        leaves = apart_m(own, soon_s, other, age_s + soon_s) > reach_m
        return max(loss, LEAVES) if leaves else loss

    def _all(self) -> list[Neighbour]:
        """A copy, as other threads ask for ways, too."""
        return list(self.neighbours.values())

    # Any way -----------------------------------------------------------------------------------

    def next_hops(self, node: int, came_from: int) -> Iterator[Way]:
        """The neighbours to try for a packet to `node`, the best first; mostly one is enough."""
        if node == self.gateway and not self.is_root:
            candidates = filter(self._leads_up, self._all())
            for _cost, _other, heard, neighbour in sorted(map(self._rank, candidates)):
                yield Way(neighbour, -heard)
            return
        seen: set[int] = set()
        doubtful: list[tuple[int, Way]] = []
        for way in self._ways_down(node, came_from):
            if way.neighbour not in seen:
                seen.add(way.neighbour)
                known = self.neighbours.get(way.neighbour)  # None: forgotten in another thread
                if known is not None and known.swallows and way.neighbour != node:
                    doubtful.append((len(known.vain), way))
                else:
                    yield way
        for _vain, way in sorted(doubtful, key=itemgetter(0)):
            yield way

    def _ways_down(self, node: int, came_from: int) -> Iterator[Way]:
        """The same for a node that is no gateway, and some of them more than once."""
        direct = self.neighbours.get(node)
        is_doubtful = direct is None or not direct.usable or self.risk(direct) >= GONE
        if direct is not None and not is_doubtful:
            yield Way(node, direct.alive_s)
        hint, at_s = self._hints.get(node, (NO_ROUTE, -math.inf))
        if hint in self.neighbours and self.clock.now_s - at_s < HINT_S:
            yield Way(hint, at_s)
        announcements = sorted(self._announcements(node))
        for (is_other, *_rest), way in announcements:
            if not is_other:
                yield way
        # After the children, which have it from its beacon: that it hears it, anybody may say.
        yield from self._next_to(node)
        for _rank, way in announcements:
            yield way
        parent, before = self.neighbours.get(self.parent), self.neighbours.get(came_from)
        comes_from_below = before is not None and before.beacon.parent == self._node_id
        if parent is not None and (came_from == NO_ROUTE or comes_from_below):
            yield Way(parent.node, parent.heard_s)  # up, to who knows more
        yield from self._nearer(node)
        if direct is not None and is_doubtful and not direct.deaf:
            yield Way(node, direct.alive_s)

    def _next_to(self, node: int) -> list[Way]:
        """The neighbours that hear `node` themselves, the one that showed it last first."""
        shown = []
        for neighbour in self._all():
            at_s = neighbour.near_s.get(node, -math.inf)
            age_s = self.clock.now_s - at_s
            if age_s < NEAR * neighbour.beacon.interval_s and neighbour.usable:
                shown.append((age_s + self.risk(neighbour), Way(neighbour.node, at_s)))
        return [way for _rank, way in sorted(shown)]

    def _announcements(self, node: int) -> Iterator[tuple[tuple[bool, int, float], Way]]:
        """The neighbours that announce `node` below them; a child, and the latest, first.

        Among children that dispute it, the one with the fewest such claims, and the first. Then
        those whose way up leads over it, unless it comes here first, the nearest to it first.
        """
        now_s = self.clock.now_s
        for neighbour in filter(lambda one: one.usable, self._all()):
            at_s = neighbour.announced_s.get(node)
            if at_s is not None:
                is_child = neighbour.beacon.parent == self._node_id
                claims = self._disputes.about(neighbour.node, node, now_s) if is_child else 0
                age_s = at_s if claims else now_s - at_s + self.risk(neighbour)
                listed_s = neighbour.listed_s.get(node, at_s)
                yield (not is_child, claims, age_s), Way(neighbour.node, listed_s)
                continue
            up = neighbour.beacon.parent, *neighbour.beacon.ancestors
            if node in up and self._node_id not in up[: up.index(node)]:
                yield (True, up.index(node), math.inf), Way(neighbour.node, neighbour.heard_s)

    def _nearer(self, node: int) -> list[Way]:
        """The neighbours that are nearer to the last known place of `node`, the nearest first."""
        seen = self._place_of(node)
        if seen is None or self.motion is None or self.clock.now_s - seen.heard_s > SEEN_S:
            return []
        goal = seen.place
        own_m = metres_between(self.motion.place, goal)
        nearer_ones = []
        for neighbour in self._all():
            motion = neighbour.motion
            if motion is not None and neighbour.usable and self.risk(neighbour) < GONE:
                off_m = metres_between(motion.place, goal)
                if off_m < own_m:
                    nearer_ones.append((off_m, Way(neighbour.node, neighbour.heard_s)))
        return [way for _off_m, way in sorted(nearer_ones)]

    # IRoutes -----------------------------------------------------------------------------------

    def get_direction_to_node(self, node: int) -> int:
        """The best next hop for a packet of this node, or NO_ROUTE."""
        if node == NO_ROUTE:  # as the gateway is, of who has chosen none
            return NO_ROUTE
        way = next(self.next_hops(node, NO_ROUTE), None)
        return NO_ROUTE if way is None else way.neighbour

    def may_reach(self, node: int) -> bool:
        """A packet waits for a next hop, as long as there is anybody to search through."""
        return bool(self.neighbours)

    def get_table_size(self) -> int:
        """Neighbours, and what each has announced."""
        return sum(1 + len(n.announced_s) for n in list(self.neighbours.values()))

    def get_set_of_children(self) -> frozenset[int]:
        """Ids of the nodes in direct reach, in both directions."""
        return frozenset(n.node for n in self._all() if not n.deaf)

    def heard_by(self, node: int) -> frozenset[int]:
        """Its parent and children, and the neighbours that its latest beacons showed."""
        known = self.neighbours.get(node)
        if known is None:
            return frozenset()
        since_s = self.clock.now_s - SHOWN_S
        near = {other for other, at_s in known.near_s.items() if at_s > since_s}
        near.update(n.node for n in self._all() if n.beacon.parent == node)
        return frozenset(near | {known.beacon.parent}) - {NO_ROUTE}

    def has_own_way(self, node: int) -> bool:
        """What its beacons say, or, of a node two hops away, those of the children here."""
        me, known = self._node_id, self.neighbours.get(node)
        if known is None:
            return not any(n.beacon.parent == me and node in n.announced_s for n in self._all())
        beacon = known.beacon
        is_below = beacon.parent == me or me in beacon.ancestors
        return beacon.gateway != NO_ROUTE and not is_below

    def node_moved_location(self) -> None:
        """The next beacons show where everybody is; who is deaf there must show anew."""
        for neighbour in self.neighbours.values():
            neighbour.hears_perhaps()
