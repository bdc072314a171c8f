"""How near flights come to each other: geometry of their paths, whenever they are flown."""

from __future__ import annotations

from typing import Sequence

import numpy as np

from drone_mesh.drone.flight_path import FlightPath, Vector


def segments(corners: Sequence[Sequence[float]]) -> np.ndarray:
    """The straight lines through these corners, shape (n, 2, 3), metres."""
    points: np.ndarray = np.asarray(corners, dtype=float).reshape(-1, 3)
    if len(points) == 1:
        points = points.repeat(2, axis=0)
    pairs: np.ndarray = np.stack([points[:-1], points[1:]], axis=1)
    return pairs


def ways_of(path: FlightPath) -> np.ndarray:
    """Where this flight may lead, as segments.

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
