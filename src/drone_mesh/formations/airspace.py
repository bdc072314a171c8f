"""Airspace: the space that drones take, and whether another flight fits in."""

from __future__ import annotations

from typing import Sequence

import numpy as np

from drone_mesh.drone.flight_path import FlightPath, Vector
from drone_mesh.drone.goal import ROUNDING_M

APART_M = 1.0  # least distance between two drones on the way
SWAY_M = 0.5  # how far physics may move a drone from its path
_TOUCH_M = 1e-3  # rounding of positions


class Airspace:
    """The drones in flight or about to set out, and those at rest.

    A path takes its space as a whole: the time at which a drone is where does not count.
    """

    def __init__(self, sway_m: float, clearance_m: float) -> None:
        """`clearance_m`: the least distance between two drones at rest."""
        self._apart_m = APART_M + sway_m
        self._clearance_m = clearance_m - ROUNDING_M
        self._ways = np.empty((0, 2, 3))  # segments of all flights
        self._ends = np.empty((0, 2, 3))  # where the flight of each segment begins and ends
        self._places = np.empty((256, 3))  # of resting drones, by id
        self._rests: np.ndarray = np.zeros(256, dtype=bool)

    def add_resting(self, drone: int, place: Sequence[float]) -> None:
        """This drone rests there."""
        self._places[drone] = place
        self._rests[drone] = True

    def add_flying(self, corners: Sequence[Sequence[float]]) -> None:
        """A drone flies along these corners: its place now, and what is left of its path."""
        self._add(segments(corners), corners[0], corners[-1])

    def set_out(self, drone: int, path: FlightPath) -> None:
        """This drone leaves its place, or is about to."""
        self._rests[drone] = False
        self._add(ways_of(path), path.start, path.goal)

    def _add(self, ways: np.ndarray, start: Sequence[float], end: Sequence[float]) -> None:
        ends = np.broadcast_to(np.asarray([start, end], dtype=float), ways.shape)
        self._ways = np.concatenate([self._ways, ways])
        self._ends = np.concatenate([self._ends, ends])

    def meets_flight(self, path: FlightPath) -> bool:
        """Whether this flight comes too near to one in the air, or ends too near to its end.

        Drones that begin or end near each other may be that near on the way, too.
        """
        if not len(self._ways):
            return False
        starts_m, ends_m = (
            _away_m(self._ends[:, end], point) for end, point in enumerate((path.start, path.goal))
        )
        allowed_m = np.minimum(self._apart_m, np.minimum(starts_m, ends_m)) - _TOUCH_M
        meets = nearest_m(ways_of(path), self._ways) < allowed_m
        return bool((meets | (ends_m < self._clearance_m)).any())

    def in_the_way(self, drone: int, path: FlightPath) -> list[int]:
        """The resting drones to which this flight would come too near, or end too near."""
        self._rests[drone], rested = False, self._rests[drone]
        others = np.flatnonzero(self._rests)
        self._rests[drone] = rested
        places = self._places[others]
        starts_m, ends_m = (_away_m(places, point) for point in (path.start, path.goal))
        allowed_m = np.minimum(self._apart_m, np.minimum(starts_m, ends_m)) - _TOUCH_M
        ways = ways_of(path)[:, None]
        near_m = _point_m(places, ways[..., 0, :], ways[..., 1, :]).min(axis=0)
        found = others[(near_m < allowed_m) | (ends_m < self._clearance_m)]
        return [int(other) for other in found]


def _away_m(places: np.ndarray, point: Sequence[float]) -> np.ndarray:
    away = places - np.asarray(point, dtype=float)
    length: np.ndarray = np.sqrt((away * away).sum(axis=-1))
    return length


def segments(corners: Sequence[Sequence[float]]) -> np.ndarray:
    """The straight lines through these corners, shape (n, 2, 3), metres."""
    points: np.ndarray = np.asarray(corners, dtype=float).reshape(-1, 3)
    if len(points) == 1:
        points = points.repeat(2, axis=0)
    pairs: np.ndarray = np.stack([points[:-1], points[1:]], axis=1)
    return pairs


def ways_of(path: FlightPath) -> np.ndarray:
    """The space that this flight may take, as segments.

    A kinematic drone flies across in a slope, a dynamic one at the higher end of it.
    """
    high_m = max(corner[2] for corner in path.across)
    level: list[Vector] = [(x, y, high_m) for x, y, _z in path.across]
    ways = [path.waypoints]
    if any(corner[2] != high_m for corner in path.across):
        ways.append((path.start, *level, path.goal))
    found: np.ndarray = np.concatenate([segments(way) for way in ways])
    return found


def nearest_m(ways: np.ndarray, others: np.ndarray) -> np.ndarray:
    """The least distance from any of `ways` (n, 2, 3) to each of `others` (m, 2, 3): (m,)."""
    start, end = ways[:, None, 0], ways[:, None, 1]
    other_start, other_end = others[None, :, 0], others[None, :, 1]
    best = _lines_m(start, end, other_start, other_end)
    for point in (start, end):
        best = np.minimum(best, _point_m(point, other_start, other_end))
    for point in (other_start, other_end):
        best = np.minimum(best, _point_m(point, start, end))
    least: np.ndarray = best.min(axis=0)
    return least


def _point_m(point: np.ndarray, start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Distance of points to segments."""
    along = end - start
    length2 = (along * along).sum(axis=-1)
    share = ((point - start) * along).sum(axis=-1) / np.where(length2 > 0.0, length2, 1.0)
    away = point - start - share.clip(0.0, 1.0)[..., None] * along
    length: np.ndarray = np.sqrt((away * away).sum(axis=-1))
    return length


def _lines_m(
    start: np.ndarray, end: np.ndarray, other_start: np.ndarray, other_end: np.ndarray
) -> np.ndarray:
    """Distance of segments whose nearest points are inside both; infinity for all others."""
    one, other, gap = end - start, other_end - other_start, start - other_start
    a, e = (one * one).sum(axis=-1), (other * other).sum(axis=-1)
    b, c, f = (one * other).sum(axis=-1), (one * gap).sum(axis=-1), (other * gap).sum(axis=-1)
    spread = a * e - b * b
    inside = spread > 1e-9  # not parallel; ends decide otherwise
    safe = np.where(inside, spread, 1.0)
    s, t = (b * f - c * e) / safe, (a * f - b * c) / safe
    inside &= (s >= 0.0) & (s <= 1.0) & (t >= 0.0) & (t <= 1.0)
    away = gap + s[..., None] * one - t[..., None] * other
    length: np.ndarray = np.where(inside, np.sqrt((away * away).sum(axis=-1)), np.inf)
    return length
