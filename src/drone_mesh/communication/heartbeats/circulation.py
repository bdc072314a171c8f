"""Detects packets that circulate (docs/protocol.md, "Circulating packets")."""

from __future__ import annotations

import math
from typing import Hashable, Tuple

from drone_mesh.communication.timing import CIRCULATION_S

LEAST_LOOP = 3  # links: no node sends a packet straight back to where it came from

Passage = Tuple[int, int, float, int]
"""A packet's first passage: the neighbour that it came from, the next hop, the time and its hop
count. A plain tuple, as there is one for each packet."""


class CirculationGuard:
    """Remembers for a while which packets passed through this node.

    A packet is identified by what does not change on its way: creator, type, final addressee and
    body.
    """

    def __init__(self, window_s: float = CIRCULATION_S) -> None:
        """`window_s`: how long it remembers."""
        self._window_s = window_s
        # Two tables used in turn, so that old passages are forgotten without a search for them.
        self._passages: dict[Hashable, Passage] = {}
        self._earlier: dict[Hashable, Passage] = {}
        self._turn_s = -math.inf  # when the earlier ones are forgotten

    def first_passage(self, identity: Hashable, now_s: float) -> Passage | None:
        """The packet's first passage, if it remembers one."""
        passage = self._passages.get(identity) or self._earlier.get(identity)
        return None if passage is None or now_s - passage[2] >= self._window_s else passage

    def passed(
        self, identity: Hashable, came_from: int, went_to: int, now_s: float, hops: int = 0
    ) -> None:
        """Record the first passage of a packet that was forwarded."""
        if now_s >= self._turn_s:
            self._turn_s = now_s + self._window_s
            self._passages, self._earlier = {}, self._passages
        self._passages[identity] = (came_from, went_to, now_s, hops)


def came_round(first: Passage, creator: int, came_from: int, hops: int | None = None) -> int | None:
    """The next hop of the packet's first passage, if it now comes round from another neighbour.

    What comes straight from its creator was sent again. A heartbeat counts its hops: one with only
    a few more of them was sent again, too, another way.
    """
    first_from, went_to, _at_s, first_hops = first
    if came_from in (creator, first_from):
        return None
    if hops is not None and hops < first_hops + LEAST_LOOP:
        return None
    return went_to
