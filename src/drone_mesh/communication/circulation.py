"""Detects packets that circulate (docs/protocol.md, "Circulating packets")."""

from __future__ import annotations

from collections import deque
from typing import Tuple

from drone_mesh.communication.timing import CIRCULATION_S

_Passage = Tuple[int, int, float, int]
"""How a packet was handed on when it came for the first time: the neighbour that it came from, the
next hop, the time and the hops that it counted. A plain tuple, as there is one for each packet."""


class CirculationGuard:
    """Remembers for half a second which packets passed through this node.

    A packet is known by what does not change on its way: creator, type, final addressee and body.
    """

    def __init__(self) -> None:
        self._passages: dict[bytes, _Passage] = {}
        self._ages: deque[tuple[float, bytes]] = deque()

    def came_round(
        self, identity: bytes, came_from: int, now_s: float, hops: int = 0
    ) -> int | None:
        """The next hop that a packet was handed to before, if it now comes from another neighbour.

        A heartbeat counts its hops: only with more `hops` than before has it come round.
        """
        while self._ages and now_s - self._ages[0][0] >= CIRCULATION_S:
            at_s, old = self._ages.popleft()
            if old in self._passages and self._passages[old][2] == at_s:
                del self._passages[old]
        passage = self._passages.get(identity)
        if passage is None:
            return None
        first_from, went_to, _at_s, first_hops = passage
        return None if first_from == came_from or (hops and hops <= first_hops) else went_to

    def passed(
        self, identity: bytes, came_from: int, went_to: int, now_s: float, hops: int = 0
    ) -> None:
        """The packet was handed on. The first passage is the one that counts."""
        if identity not in self._passages:
            self._passages[identity] = (came_from, went_to, now_s, hops)
            self._ages.append((now_s, identity))
