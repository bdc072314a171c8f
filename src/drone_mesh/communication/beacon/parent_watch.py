"""ParentWatch: when a node asks whether its parent lives, and hears it."""

from __future__ import annotations

import math
import random

from drone_mesh.communication.beacon.neighbour import Neighbour
from drone_mesh.communication.beacon.routes import BeaconRoutes

LATE = 1.25  # intervals, with their jitter: then a beacon of the parent was lost, or it is dead
LATE_S = 2.0  # one lost beacon of a frequent sender says little
PROOF_S = 5.0  # for so long a parent that names its children in turn is not asked
TURN_HOPS = 8  # for each neighbour: children ask one after the other, and the answer is for all


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
        return min(self._late_s(parent), self._routes.proved_s + PROOF_S)

    def _late_s(self, parent: Neighbour) -> float:
        interval_s = parent.beacon.interval_s
        silent_s = max(LATE * interval_s, min(2.0 * interval_s, LATE_S))
        turns_s = TURN_HOPS * self._hop_s * len(self._routes.neighbours)
        return parent.alive_s + silent_s + self._turn * turns_s
