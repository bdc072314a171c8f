"""The shortest path round boxes at one height: straight lines from corner to corner."""

from __future__ import annotations

import heapq
import math
from typing import Sequence

from drone_mesh.air.box import Box
from drone_mesh.drone.flight_path import Point

MOST_BOXES = 10  # our choice: on one path; the search time grows with the cube
BESIDE_M = 0.01  # distance of a corner of the path from its box, so that it does not touch it


def way_round(
    boxes: Sequence[Box], start: Point, goal: Point, height_m: float
) -> tuple[Point, ...] | None:
    """The corners (x, y in metres) of the shortest path from start to goal at this height.

    None: there is no path, or it passes more than MOST_BOXES. Only boxes that the path meets count:
    each search adds those that the previous path met.
    """
    met: list[Box] = []
    while len(met) <= MOST_BOXES:
        way = _shortest(met, start, goal, height_m)
        if way is None:
            return None
        new = [
            box
            for box in boxes
            if box not in met and any(_is_met(box, *leg, height_m) for leg in zip(way, way[1:]))
        ]
        if not new:
            return way[1:-1]
        met += new
    return None


def _shortest(
    boxes: Sequence[Box], start: Point, goal: Point, height_m: float
) -> tuple[Point, ...] | None:
    """A* over the corners of the boxes; two see each other if no box is between them."""
    points = [start, goal, *(c for box in boxes for c in box.grown(BESIDE_M).corners)]
    came_from: dict[int, int] = {}
    waiting = [(0.0, 0.0, 0, 0)]  # least total length, length so far, point, previous point
    while waiting:
        _least, metres, here, before = heapq.heappop(waiting)
        if here in came_from:
            continue
        came_from[here] = before
        if here == 1:
            way = [1]
            while way[-1] != 0:
                way.append(came_from[way[-1]])
            return tuple(points[index] for index in reversed(way))
        for other, point in enumerate(points):
            if other in came_from or any(
                _is_met(box, points[here], point, height_m) for box in boxes
            ):
                continue
            until = metres + math.dist(points[here], point)
            heapq.heappush(waiting, (until + math.dist(point, goal), until, other, here))
    return None


def _is_met(box: Box, a: Point, b: Point, height_m: float) -> bool:
    return box.chord((*a, height_m), (*b, height_m)) is not None
