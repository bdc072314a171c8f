"""OwnId: what a node does about another radio that uses its id (docs/protocol.md, "One id twice").

Both name it. A router that was first connected less than a check period ago gives way to one that
is connected: it switches its antenna off for a while, as a radio that listens also acknowledges
packets for the other one.
"""

from __future__ import annotations

import math
import random

from drone_mesh.communication.timing import RateLimit

SHARED_FOR_S = 60.0  # for so long after the last packet of the other, both say so
OFF_S = 30.0  # the antenna of a node that gives way is off for 1 to 2 times this
INTRODUCTIONS = 3  # in OFF_S, so that the other one hears one each time it comes back


class OwnId:
    """Another radio with the id of one node. Belongs to the component's thread."""

    def __init__(self, rng: random.Random) -> None:
        """`rng` spreads the time off, so that two nodes that gave way do not return together."""
        self._rng = rng
        self.connected_s = math.inf  # when the node was first connected, since it last gave way
        self._heard_s = -math.inf
        self._introductions = RateLimit(INTRODUCTIONS, OFF_S)

    @property
    def was_heard(self) -> bool:
        """Whether the other radio was ever heard, so that this node has shown itself to it."""
        return self._heard_s > -math.inf

    def heard(self, now_s: float) -> bool:
        """Record a packet of the other radio. Returns whether to introduce this node to it."""
        self._heard_s = now_s
        return self._introductions.count(0, now_s)

    def give_way(self, now_s: float) -> float:
        """Give way to the other radio, which is connected. Returns when to switch on again."""
        self._heard_s = now_s
        self.connected_s = math.inf
        return now_s + OFF_S * (1.0 + self._rng.random())

    def is_shared(self, now_s: float) -> bool:
        """Whether the other radio was heard lately. Any thread may ask."""
        return now_s - self._heard_s <= SHARED_FOR_S
