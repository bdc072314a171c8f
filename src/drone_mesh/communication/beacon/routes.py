"""BeaconRoutes: the ways of one node to all others, from the beacons that it hears.

docs/beacons.md, "Beacons", describes the rules.
"""

from __future__ import annotations

import math
from operator import itemgetter
from typing import Callable, Final, Iterator, NamedTuple

from drone_mesh.communication.beacon.disputes import Disputes
from drone_mesh.communication.beacon.neighbour import Neighbour
from drone_mesh.communication.beacon.neighbourhood import GONE
from drone_mesh.communication.beacon.packets import Beacon
from drone_mesh.communication.beacon.way_up import STALE, WayUp
from drone_mesh.communication.interfaces import NO_ROUTE
from drone_mesh.communication.neighbours import HeardPlace
from drone_mesh.communication.timing import Deadlines
from drone_mesh.drone.location import metres_between

SEEN_S: Final = 10.0  # an older place of a node does not tell the way to it
NEAR: Final = 2.0  # intervals: an older report that a neighbour hears a node shows no way to it
SHOWN_S: Final = 20.0  # beacons with little room show all neighbours of their sender in this time
HINT_S: Final = 3.0  # a packet that came from a node shows the way to it for this long


class Way(NamedTuple):
    """A neighbour that may lead to a node, and when it showed that."""

    neighbour: int
    shown_s: float


class BeaconRoutes(WayUp):
    """All that one node knows about the others. Belongs to its component's thread."""

    def __init__(
        self,
        node_id: int,
        is_gateway: bool,
        range_m: float,
        place_of: Callable[[int], HeardPlace | None],
        one_loss_counts: bool,
        clock: Deadlines,
        may_be_gateway: Callable[[int], bool] = lambda _node: True,
    ) -> None:
        """`place_of`: where a node was seen last. The others as for WayUp."""
        super().__init__(node_id, is_gateway, range_m, one_loss_counts, clock, may_be_gateway)
        self._place_of = place_of
        self._hints: dict[int, tuple[int, float]] = {}  # by node: a neighbour that led to it, when
        self._disputes = Disputes()

    # What it learns ----------------------------------------------------------------------------

    def heard(self, node: int, beacon: Beacon) -> bool:
        """A beacon of a neighbour. Returns whether it is a new one."""
        is_new = super().heard(node, beacon)
        if beacon.parent == self._node_id:
            neighbour = self.neighbours[node]
            if neighbour.announced_s:
                self._compare(neighbour)
        return is_new

    def _compare(self, child: Neighbour) -> None:
        """Compare what a child has listed with what the other children list."""
        settles_s = STALE * self._slowest_s()
        for other in self.neighbours.values():
            if other.beacon.parent == self._node_id and other is not child:
                self._disputes.compare(child, other, settles_s, self.clock.now_s)

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

    def led_s(self, node: int) -> float:
        """When a packet of this node came last over a relay. Any thread."""
        _neighbour, at_s = self._hints.get(node, (NO_ROUTE, -math.inf))
        return at_s

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

    def get_table_size(self) -> int:
        """Neighbours, and what each has announced."""
        return sum(1 + len(n.announced_s) for n in list(self.neighbours.values()))

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
