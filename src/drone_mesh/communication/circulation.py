"""Detects packets that circulate (docs/protocol.md, "Circulating packets")."""

from __future__ import annotations

from collections import deque
from typing import NamedTuple

from drone_mesh.communication.timing import CIRCULATION_S


class Passage(NamedTuple):
    """How a packet was handed on when it came for the first time."""

    came_from: int
    went_to: int
    at_s: float
    hops: int


class CirculationGuard:
    """Remembers for half a second which packets passed through this node.

    A packet is known by what does not change on its way: creator, type, final addressee and body.
    """

    def __init__(self) -> None:
        self._passages: dict[bytes, Passage] = {}
        self._ages: deque[tuple[float, bytes]] = deque()

    def came_round(
        self, identity: bytes, came_from: int, now_s: float, hops: int = 0
    ) -> Passage | None:
        """The first passage of a packet that now comes from another neighbour, else None.

        A heartbeat counts its hops: only with more `hops` than before has it come round.
        """
        while self._ages and now_s - self._ages[0][0] >= CIRCULATION_S:
            at_s, old = self._ages.popleft()
            if old in self._passages and self._passages[old].at_s == at_s:
                del self._passages[old]
        first = self._passages.get(identity)
        if first is None or first.came_from == came_from or (hops and hops <= first.hops):
            return None
        return first

    def passed(
        self, identity: bytes, came_from: int, went_to: int, now_s: float, hops: int = 0
    ) -> None:
        """The packet was handed on. The first passage is the one that counts."""
        if identity not in self._passages:
            self._passages[identity] = Passage(came_from, went_to, now_s, hops)
            self._ages.append((now_s, identity))
