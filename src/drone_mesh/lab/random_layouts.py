"""Random layouts: drones in a square, all connected by radio."""

from __future__ import annotations

import math
import random
from typing import Sequence, Tuple

Point = Tuple[float, float]  # x, y in metres

LEAST_DISTANCE_M = 1.0  # our choice: least distance between drones at the start
MOST_TRIES = 10_000


def random_layout(rng: random.Random, nodes: int, degree: float, range_m: float) -> list[Point]:
    """Points uniform in a square in which a node has `degree` neighbours on average.

    Redraws points that are too close to others, and layouts that are not connected.
    """
    side_m = math.sqrt(nodes * math.pi * range_m**2 / (degree + 1.0))
    for _try in range(MOST_TRIES):
        points: list[Point] = []
        while len(points) < nodes:
            point = (rng.uniform(0.0, side_m), rng.uniform(0.0, side_m))
            if all(math.dist(point, other) >= LEAST_DISTANCE_M for other in points):
                points.append(point)
        if len(reachable(points, range_m, 0)) == nodes:
            return points
    raise RuntimeError(f"no connected layout of {nodes} nodes with {degree:.1f} neighbours each")


def reachable(
    points: Sequence[Point], range_m: float, start: int, without: int | None = None
) -> set[int]:
    """The points reachable from `start` by hops shorter than `range_m`, without `without`."""
    known, edge = {start}, [start]
    while edge:
        here = points[edge.pop()]
        for other, point in enumerate(points):
            is_new = other not in known and other != without
            if is_new and math.dist(here, point) < range_m:
                known.add(other)
                edge.append(other)
    return known


def cut_vertices(points: Sequence[Point], range_m: float, root: int) -> list[int]:
    """The points without which others are cut off from `root`."""
    everything = len(reachable(points, range_m, root))
    return [
        point
        for point in range(len(points))
        if point != root and len(reachable(points, range_m, root, without=point)) < everything - 1
    ]
