"""Simple solids made of triangles, in metres, z up."""

from __future__ import annotations

import math
from typing import List, Sequence, Tuple

from drone_mesh.drone.flight_path import Vector

Triangle = Tuple[Vector, Vector, Vector]  # counterclockwise, seen from outside
Solid = List[Triangle]


def prism(outline: Sequence[tuple[float, float]], low: float, high: float) -> Solid:
    """The convex `outline`, counterclockwise from above, between two heights."""
    lower = [(x, y, low) for x, y in outline]
    upper = [(x, y, high) for x, y in outline]
    triangles: Solid = []
    for i in range(1, len(outline) - 1):
        triangles.append((upper[0], upper[i], upper[i + 1]))
        triangles.append((lower[0], lower[i + 1], lower[i]))
    for i, j in zip(range(len(outline)), [*range(1, len(outline)), 0]):
        triangles += _quad(lower[i], lower[j], upper[j], upper[i])
    return triangles


def polygon(
    center: tuple[float, float], radius: float, corners: int, turned_rad: float = 0.0
) -> list[tuple[float, float]]:
    """The corners of a regular polygon, counterclockwise."""
    angles = [turned_rad + 2 * math.pi * i / corners for i in range(corners)]
    return [(center[0] + radius * math.cos(a), center[1] + radius * math.sin(a)) for a in angles]


def bar(
    start: tuple[float, float], end: tuple[float, float], width: float
) -> list[tuple[float, float]]:
    """The outline of a bar along a line, counterclockwise."""
    length = math.dist(start, end)
    aside = (
        -(end[1] - start[1]) / length * width / 2,
        (end[0] - start[0]) / length * width / 2,
    )
    return [
        (start[0] - aside[0], start[1] - aside[1]),
        (end[0] - aside[0], end[1] - aside[1]),
        (end[0] + aside[0], end[1] + aside[1]),
        (start[0] + aside[0], start[1] + aside[1]),
    ]


def dome(radius: float, low: float, high: float, corners: int, rings: int) -> Solid:
    """Half an ellipsoid about the z axis, without a floor."""
    levels = []
    for ring in range(rings):
        angle = math.pi / 2 * ring / rings
        outline = polygon((0.0, 0.0), radius * math.cos(angle), corners)
        levels.append([(x, y, low + (high - low) * math.sin(angle)) for x, y in outline])
    triangles: Solid = []
    following = [*range(1, corners), 0]
    for below, above in zip(levels, levels[1:]):
        for i, j in enumerate(following):
            triangles += _quad(below[i], below[j], above[j], above[i])
    for i, j in enumerate(following):
        triangles.append((levels[-1][i], levels[-1][j], (0.0, 0.0, high)))
    return triangles


def normal(triangle: Triangle) -> Vector:
    """Unit vector out of the solid."""
    a, b, c = triangle
    u, v = ([end[i] - a[i] for i in range(3)] for end in (b, c))
    cross = (u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0])
    length = math.sqrt(sum(part * part for part in cross)) or 1.0
    return (cross[0] / length, cross[1] / length, cross[2] / length)


def _quad(a: Vector, b: Vector, c: Vector, d: Vector) -> Solid:
    return [(a, b, c), (a, c, d)]
