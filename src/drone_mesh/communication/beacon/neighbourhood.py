"""Neighbourhood: whom one node hears, and how long each link will last (docs/beacons.md)."""

from __future__ import annotations

import math
from typing import Final

from drone_mesh.communication.beacon.neighbour import (
    FRESH,
    FRESH_IF_LOSSY,
    WRONG,
    Losses,
    Neighbour,
)
from drone_mesh.communication.beacon.packets import Beacon, Motion, apart_m
from drone_mesh.communication.control.delivery import IRoutes
from drone_mesh.communication.timing import Deadlines

DUE: Final = 1.2  # intervals, with their jitter: until then a neighbour's next beacon is not late
REACH: Final = 0.97  # of the range: two nodes further apart are expected to lose each other
LEAVES: Final = 1.0  # hops that a detour may cost around a link that will break
GONE: Final = 3.0  # or around one that should have


class Neighbourhood(IRoutes):
    """The neighbours of one node, from their beacons; BeaconRoutes adds the ways over them.

    Belongs to its component's thread.
    """

    def __init__(self, range_m: float, one_loss_counts: bool, clock: Deadlines) -> None:
        """`one_loss_counts`: see Policy."""
        self._range_m = range_m
        self.one_loss_counts = one_loss_counts
        self.clock = clock
        self.neighbours: dict[int, Neighbour] = {}
        self.motion: Motion | None = None  # this node's own
        self._ends_s = math.inf  # no neighbour will have been silent for too long before
        self._losses = Losses(range_m)
        self._fresh = FRESH if one_loss_counts else FRESH_IF_LOSSY

    @property
    def now_s(self) -> float:
        """The time of the component's latest call."""
        return self.clock.now_s

    def heard(self, node: int, beacon: Beacon) -> bool:
        """A beacon of a neighbour. Returns whether it is a new one."""
        neighbour = self.neighbours.get(node)
        is_new = neighbour is None
        if neighbour is None:
            neighbour = Neighbour(node, beacon, self._fresh)
            self.neighbours[node] = neighbour
        neighbour.heard(beacon, self.motion, self.clock.now_s)
        self._lives(neighbour)
        if self.motion is not None and neighbour.motion is not None:  # maybe of an earlier beacon
            neighbour.loss = self._losses.heard(
                node, beacon.interval_s, self.motion.place, neighbour.motion.place, self.clock.now_s
            )
        return is_new

    def alive(self, node: int) -> None:
        """A sign of life of a node: a packet of it, or an acknowledgement."""
        neighbour = self.neighbours.get(node)
        if neighbour is not None:
            self._lives(neighbour)

    def _lives(self, neighbour: Neighbour) -> None:
        neighbour.alive(self.clock.now_s)
        self._ends_s = min(self._ends_s, neighbour.until_s)

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

    def _slowest_s(self) -> float:
        return max([n.beacon.interval_s for n in self._all()], default=0.0)

    def _all(self) -> list[Neighbour]:
        """A copy, as other threads ask for ways, too."""
        return list(self.neighbours.values())

    # IRoutes -----------------------------------------------------------------------------------

    def may_reach(self, node: int) -> bool:
        """A packet waits for a next hop, as long as there is anybody to search through."""
        return bool(self.neighbours)

    def get_set_of_children(self) -> frozenset[int]:
        """Ids of the nodes in direct reach, in both directions."""
        return frozenset(n.node for n in self._all() if not n.deaf)

    def node_moved_location(self) -> None:
        """The next beacons show where everybody is; who is deaf there must show anew."""
        for neighbour in self.neighbours.values():
            neighbour.hears_perhaps()
