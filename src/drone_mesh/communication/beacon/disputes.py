"""Who claims the nodes of others: children of one node that list the same nodes below them."""

from __future__ import annotations

import math
from typing import Final

from drone_mesh.communication.beacon.neighbour import Neighbour

REMEMBERED_S: Final = 60.0  # who claims in turns is believed for the first part of so long a turn


class Disputes:
    """The nodes that two children of this one list, longer than a move from one to the other takes.

    A node is below one child only, and a child that has lost it soon stops to list it. Nothing
    tells which of two that go on is right, so both claims are disputed; but who claims the nodes of
    all others has more of such claims than each of them.
    """

    def __init__(self) -> None:
        # By child and node: when it first claimed what another one had, and when that was disputed.
        self._began_s: dict[tuple[int, int], float] = {}
        self._disputed_s: dict[int, dict[int, float]] = {}

    def compare(self, one: Neighbour, other: Neighbour, settles_s: float, now_s: float) -> None:
        """Note what both children list; a move is known everywhere after `settles_s`."""
        for node in one.announced_s.keys() & other.announced_s.keys():
            is_first = one.announced_s[node] <= other.announced_s[node]
            had, has = (one, other) if is_first else (other, one)
            began_s = self._began_s.get((has.node, node), -math.inf)
            if began_s < had.announced_s[node]:
                self._began_s[has.node, node] = now_s
            elif had.listed_s[node] - began_s > settles_s:  # so it had not lost it
                for child in (one, other):
                    self._disputed_s.setdefault(child.node, {})[node] = now_s

    def about(self, child: int, node: int, now_s: float) -> int:
        """How many claims of this child are disputed; 0 if that for `node` is not. Any thread."""
        claims, since_s = self._disputed_s.get(child, {}), now_s - REMEMBERED_S
        if claims.get(node, -math.inf) < since_s:
            return 0
        return sum(at_s >= since_s for at_s in list(claims.values()))
