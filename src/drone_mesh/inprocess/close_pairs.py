"""Which of many points that move are within a distance of each other."""

from __future__ import annotations

from typing import Iterator

import numpy as np

MARGIN = 0.2  # of the reach: who moves a twentieth of it per second is compared to all each 2 s


def _squares(vectors: np.ndarray) -> np.ndarray:
    squares: np.ndarray = np.einsum("...i,...i->...", vectors, vectors)
    return squares


class Surroundings:
    """The points that may be within reach of each: all that are, and some others.

    Those within reach and a margin, until a point has moved by half the margin (Verlet, Physical
    Review 159, 1967).
    """

    def __init__(self, reach_m: float, margin: float, places: np.ndarray) -> None:
        """`margin`: of the reach. `places`: (n, 3), metres; a point at NaN may be anywhere."""
        self._reach_m = reach_m
        self._margin_m = margin * reach_m
        self._find(places)

    def follow(self, places: np.ndarray) -> None:
        """The points have moved; those at NaN are still the same."""
        if (_squares(places - self._found_at) > (self._margin_m / 2) ** 2).any():
            self._find(places)

    def of(self, row: int) -> list[int]:
        """The rows of the points that may be within reach of this one, ascending."""
        rows: list[int] = self._may_be[row].nonzero()[0].tolist()
        return rows

    def _find(self, places: np.ndarray) -> None:
        away = places[:, None] - places[None]
        self._may_be = ~(_squares(away) > (self._reach_m + self._margin_m) ** 2)  # False for NaN
        self._found_at = places


class ClosePairs(Surroundings):
    """The pairs of points within reach, sought only among those that may have got there."""

    def __init__(self, reach_m: float, places: np.ndarray) -> None:
        """`places`: (n, 3), metres."""
        super().__init__(reach_m, MARGIN, places)
        self._close = self._closest(places)

    def moved_to(self, places: np.ndarray) -> Iterator[tuple[int, int, bool]]:
        """The points have moved: rows of the pairs that are now within reach, or no longer."""
        self.follow(places)
        before, self._close = self._close, self._closest(places)
        if not np.array_equal(before, self._close):
            for pair in map(int, np.setxor1d(before, self._close, assume_unique=True)):
                yield (*divmod(pair, len(places)), pair in self._close)

    def _find(self, places: np.ndarray) -> None:
        super()._find(places)
        self._one, self._other = np.nonzero(np.triu(self._may_be, 1))
        self._pairs = self._one * len(places) + self._other

    def _closest(self, places: np.ndarray) -> np.ndarray:
        """The pairs within reach, ascending; each as n times its lower row plus the other one."""
        apart = np.take(places, self._one, axis=0) - np.take(places, self._other, axis=0)
        close: np.ndarray = self._pairs[_squares(apart) < self._reach_m**2]
        return close
