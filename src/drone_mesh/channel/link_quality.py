"""LinkQuality: how well packets reach each neighbour."""

from __future__ import annotations

from typing import Mapping, NamedTuple

_LEARNING = 0.1  # weight of the latest packet


class Quality(NamedTuple):
    """Quality of one link: moving averages over recent packets."""

    tries: float  # per packet, delivered or not; those included that the radio made by itself
    delivered: float  # share, 0..1


class LinkQuality:
    """One thread writes, any thread reads: the figures are replaced, never modified."""

    def __init__(self) -> None:
        self._of: dict[int, Quality] = {}

    def packet(self, neighbour: int, tries: int, delivered: bool) -> None:
        """A packet to a neighbour was delivered or given up, after `tries`."""
        before = self._of.get(neighbour)
        latest = Quality(float(tries), float(delivered))
        if before is not None:
            latest = Quality(*(old + _LEARNING * (new - old) for old, new in zip(before, latest)))
        self._of = {**self._of, neighbour: latest}

    def figures(self) -> Mapping[int, Quality]:
        """The quality for each neighbour that packets were sent to."""
        return self._of
