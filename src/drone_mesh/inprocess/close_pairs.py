"""Which of many points that move are within a distance of each other."""

from __future__ import annotations

from typing import Iterator

import numpy as np

MARGIN = 0.2  # of the reach: who moves a twentieth of it per second is compared to all each 2 s


class ClosePairs:
    """The pairs of points within reach, sought only among those that may have got there.

    Pairs within reach and a margin are kept until a point has moved by half the margin (Verlet,
    Physical Review 159, 1967).
    """

    def __init__(self, reach_m: float, places: np.ndarray) -> None:
        """`places`: (n, 3), metres."""
        self._reach_m = reach_m
        self._margin_m = MARGIN * reach_m
        self._find(places)
        self._close = self._closest(places)

    def moved_to(self, places: np.ndarray) -> Iterator[tuple[int, int, bool]]:
        """The points have moved: rows of the pairs that are now within reach, or no longer."""
        moved = places - self._found_at
        if np.einsum("ij,ij->i", moved, moved).max(initial=0.0) > (self._margin_m / 2) ** 2:
            self._find(places)
        before, self._close = self._close, self._closest(places)
        if not np.array_equal(before, self._close):
            for pair in map(int, np.setxor1d(before, self._close, assume_unique=True)):
                yield (*divmod(pair, len(places)), pair in self._close)

    def _find(self, places: np.ndarray) -> None:
        away = places[:, None] - places[None]
        may_be = np.einsum("ijk,ijk->ij", away, away) < (self._reach_m + self._margin_m) ** 2
        self._pairs = np.nonzero(np.triu(may_be, 1))
        self._found_at = places

    def _closest(self, places: np.ndarray) -> np.ndarray:
        """The pairs within reach, ascending; each as n times its lower row plus the other one."""
        one, other = self._pairs
        apart = places[one] - places[other]
        within = np.einsum("ij,ij->i", apart, apart) < self._reach_m**2
        close: np.ndarray = (one * len(places) + other)[within]
        return close
