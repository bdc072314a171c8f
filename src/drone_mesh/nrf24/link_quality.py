"""LinkQuality: how well packets reach each neighbour."""

from __future__ import annotations

from typing import Mapping, NamedTuple

_LEARNING = 0.1  # weight of the latest packet


class Quality(NamedTuple):
    """Of the packets to one neighbour lately, the latest counting most."""

    tries: float  # per packet, delivered or not
    delivered: float  # share, 0..1


class LinkQuality:
    """One thread writes, any thread reads: the figures are replaced, never changed."""

    def __init__(self) -> None:
        self._of: dict[int, Quality] = {}

    def packet(self, neighbour: int, tries: int, delivered: bool) -> None:
        """A packet was delivered to a neighbour, or given up, after so many tries."""
        before = self._of.get(neighbour)
        latest = Quality(float(tries), float(delivered))
        if before is not None:
            latest = Quality(*(old + _LEARNING * (new - old) for old, new in zip(before, latest)))
        self._of = {**self._of, neighbour: latest}

    def figures(self) -> Mapping[int, Quality]:
        """Of each neighbour that a packet was sent to."""
        return self._of
