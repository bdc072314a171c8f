"""Which of many points that move are within a distance of each other."""

from __future__ import annotations

import itertools
from typing import Iterable, Iterator

import numpy as np

from drone_mesh.drone.location import Location

MARGIN = 0.2  # of the reach: who moves a twentieth of it per second is compared to all each 2 s


def by_axis(places: Iterable[Location]) -> np.ndarray:
    """The coordinates of n points as (3, n): numpy is slow with many rows of three."""
    rows = np.fromiter(itertools.chain.from_iterable(places), float).reshape(-1, 3)
    axes: np.ndarray = np.ascontiguousarray(rows.T)
    return axes


def _squares(vectors: np.ndarray) -> np.ndarray:
    squares: np.ndarray = (vectors * vectors).sum(axis=0)
    return squares


class Surroundings:
    """The points that may be within reach of each: all that are, and some others.

    Those within reach and a margin, until a point has moved by half the margin (Verlet, Physical
    Review 159, 1967).
    """

    def __init__(self, reach_m: float, margin: float, places: np.ndarray) -> None:
        """`margin`: of the reach. `places`: `by_axis`, metres; a point at NaN may be anywhere."""
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
        away = places[:, :, None] - places[:, None]
        self._may_be = ~(_squares(away) > (self._reach_m + self._margin_m) ** 2)  # False for NaN
        self._found_at = places


class ClosePairs(Surroundings):
    """The pairs of points within reach, sought only among those that may have got there."""

    def __init__(self, reach_m: float, places: np.ndarray) -> None:
        """`places`: `by_axis`, metres."""
        self._pairs: np.ndarray = np.zeros(0, int)  # n times one row plus the other; ascending
        self._close: np.ndarray = np.zeros(0, bool)  # of each of them: within reach
        super().__init__(reach_m, MARGIN, places)
        self._close = self._closest(places)

    def moved_to(self, places: np.ndarray) -> Iterator[tuple[int, int, bool]]:
        """The points have moved: rows of the pairs that are now within reach, or no longer."""
        self.follow(places)
        before, self._close = self._close, self._closest(places)
        for at in (before != self._close).nonzero()[0]:
            yield int(self._one[at]), int(self._other[at]), bool(self._close[at])

    def _find(self, places: np.ndarray) -> None:
        super()._find(places)
        close = self._pairs[self._close]
        self._pairs = np.union1d(np.flatnonzero(np.triu(self._may_be, 1)), close)
        self._close = np.isin(self._pairs, close, assume_unique=True)
        self._one, self._other = np.divmod(self._pairs, places.shape[1])

    def _closest(self, places: np.ndarray) -> np.ndarray:
        """Of each pair: whether it is within reach."""
        apart = np.take(places, self._one, axis=1) - np.take(places, self._other, axis=1)
        close: np.ndarray = _squares(apart) < self._reach_m**2
        return close
