"""When a node sends its beacons, and when it asks whether its parent lives, and hears it."""

from __future__ import annotations

import math
import random
from typing import Final

from drone_mesh.communication.beacon.neighbour import Neighbour
from drone_mesh.communication.beacon.packets import INTERVAL_S
from drone_mesh.communication.beacon.routes import BeaconRoutes
from drone_mesh.communication.timing import Medium

HOPS_PER_BEACON: Final = 400  # a beacon takes half a hop, and ten neighbours send as many
LEAST_S: Final = 0.5  # of an interval
RARER: Final = 1.3  # factor between one interval and the next
AT_REST_S: Final = 1.6  # a dead parent is noticed in 1.3 of it, and another one chosen
JITTER: Final = 0.2  # part of an interval by which a beacon may be early or late
SOON_HOPS: Final = 12  # an urgent beacon waits for up to so many hops, as others wait too


class Trickle:
    """The times of one node's beacons."""

    def __init__(self, medium: Medium, rng: random.Random) -> None:
        self._rng = rng
        self._least_s = max(LEAST_S, HOPS_PER_BEACON * medium.hop_s)
        self._most_s = max(AT_REST_S, 1.5 * self._least_s)
        self.longest_s = self._most_s + INTERVAL_S  # that any node says, as beacons round it up
        self._soon_s = SOON_HOPS * medium.hop_s
        self._sent_s = -math.inf
        self._changed = True  # during this interval
        self.interval_s = self._least_s
        self.due_s = math.inf

    def start(self, now_s: float) -> None:
        """Begin, at a random moment."""
        self.interval_s = self._least_s
        self.due_s = now_s + self._rng.random() * 4 * self._soon_s

    def sent(self, now_s: float) -> None:
        if not self._changed:
            self.interval_s = min(RARER * self.interval_s, self._most_s)
        self._changed = False
        self._sent_s = now_s
        self.due_s = now_s + self.interval_s * (1.0 + JITTER * (2.0 * self._rng.random() - 1.0))

    def reset(self, now_s: float) -> None:
        """Something has changed: the interval is the shortest again."""
        self._changed = True
        if self.interval_s > self._least_s:
            self.interval_s = self._least_s
            self.due_s = min(self.due_s, now_s + self._least_s * self._rng.random())

    def hurry(self, now_s: float) -> None:
        """Send the next beacon soon, because others must know of a change."""
        self.reset(now_s)
        not_before_s = max(now_s, self._sent_s + 0.2 * self._least_s)
        self.due_s = min(self.due_s, not_before_s + self._soon_s * self._rng.random())

    def answer(self, now_s: float, alone: bool) -> None:
        """A neighbour asks for a beacon, of this node `alone` or of all its neighbours."""
        if now_s - self._sent_s > 0.2 * self._least_s:
            within_s = self._soon_s if alone else 4 * self._soon_s
            self.due_s = min(self.due_s, now_s + within_s * self._rng.random())


LATE: Final = 1.25  # intervals, with jitter: then a beacon of the parent was lost, or it is dead
LATE_S: Final = 2.0  # one lost beacon of a frequent sender says little
PROOF_S: Final = 5.0  # for so long a parent that names its children in turn is not asked
TURN_HOPS: Final = 8  # for each neighbour: children ask in turn, and the answer is for all


class ParentWatch:
    """The time of the next PROBE, which the parent's radio has to acknowledge."""

    def __init__(self, routes: BeaconRoutes, hop_s: float, rng: random.Random) -> None:
        """`hop_s`: what a packet takes for one hop."""
        self._routes, self._hop_s, self._rng = routes, hop_s, rng
        self._probed_s = -math.inf
        self._turn = rng.random()  # among the children of its parent

    def has_new_parent(self) -> None:
        """Begin anew for another parent."""
        self._probed_s = -math.inf

    def draw_turn(self) -> None:
        """Take another turn among the children of the parent."""
        self._turn = self._rng.random()

    def is_due(self, parent: Neighbour) -> bool:
        """Whether to probe the parent now; if so, it counts as probed."""
        now_s = self._routes.now_s
        again_s = self._probed_s + parent.beacon.interval_s
        if not parent.usable or now_s < self._wanted_s(parent) or now_s <= again_s:
            return False
        self._probed_s = now_s
        return True

    def due_s(self, parent: Neighbour) -> float:
        """When the next probe is due if the parent neither sends nor names this node."""
        again_s = self._probed_s + parent.beacon.interval_s + 1e-3
        return max(self._wanted_s(parent), again_s)

    def _wanted_s(self, parent: Neighbour) -> float:
        interval_s = parent.beacon.interval_s
        silent_s = max(LATE * interval_s, min(2.0 * interval_s, LATE_S))
        turns_s = TURN_HOPS * self._hop_s * len(self._routes.neighbours)
        late_s = parent.alive_s + silent_s + self._turn * turns_s
        return min(late_s, self._routes.proved_s + PROOF_S)
