"""Limits on what a node spends on nodes that may not exist (docs/security.md, "Limits")."""

from __future__ import annotations

LIMIT_PERIOD_S = 10.0  # one check period
STRANGERS = 16  # losses per period of nodes that never took a packet
REPEATS = 64  # announcements of one missing node per period; lossy links need many


class RateLimit:
    """At most `times` per period and node. At most one entry per node id."""

    def __init__(self, times: int, period_s: float = LIMIT_PERIOD_S) -> None:
        self._times = times
        self._period_s = period_s
        self._counted: dict[int, tuple[float, int]] = {}  # by node: start of the period, how often

    def count(self, node: int, now_s: float) -> bool:
        """Count one more; returns whether it is within the limit."""
        since_s, times = self._counted.get(node, (now_s, 0))
        if now_s - since_s >= self._period_s:
            since_s, times = now_s, 0
        self._counted[node] = (since_s, times + 1)
        return times < self._times

    def reached(self, node: int, now_s: float) -> bool:
        """Whether one more would exceed the limit."""
        since_s, times = self._counted.get(node, (now_s, 0))
        return times >= self._times and now_s - since_s < self._period_s


class Strangers:
    """Nodes that never acknowledged a packet. If too many of them are lost, they get no packets."""

    def __init__(self) -> None:
        self.known: set[int] = set()  # acknowledged a packet; the owner adds to it
        self._losses = RateLimit(STRANGERS)

    def gave_up(self, node: int, now_s: float) -> None:
        """A packet for `node` was given up."""
        if node not in self.known:
            self._losses.count(0, now_s)

    def ignores(self, node: int, now_s: float) -> bool:
        """Whether no packet is to be spent on it now."""
        return node not in self.known and self._losses.reached(0, now_s)
