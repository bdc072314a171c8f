"""Patrols on fixed lines: a lawnmower's lanes, a loop of way-points, an oval, an eight."""

from __future__ import annotations

import math

from drone_mesh.drone.flight_path import Vector
from drone_mesh.mobility.area import Area
from drone_mesh.mobility.settings import Mobility

ARC_CORNERS = 16  # of a half circle


def lanes(mobility: Mobility, area: Area) -> list[Vector]:
    """The corners of lanes to and fro over the area; the last joins the first along the edge."""
    corners = []
    for lane in range(mobility.lanes):
        y = area.y + area.depth_m * (lane + 0.5) / mobility.lanes
        ends = [area.x, area.x + area.width_m]
        for x in ends if lane % 2 == 0 else reversed(ends):
            corners.append(mobility.at_height((x, y)))
    return corners


def oval(mobility: Mobility, middle: Vector) -> list[Vector]:
    """A racetrack: two straights of two radii each, and two half circles."""
    r, (x, y, _z) = mobility.radius_m, middle
    right = [(x + r + r * math.sin(a), y - r * math.cos(a)) for a in _half_circle()]
    left = [(x - r - r * math.sin(a), y + r * math.cos(a)) for a in _half_circle()]
    return [mobility.at_height(corner) for corner in right + left]


def eight(mobility: Mobility, middle: Vector) -> list[Vector]:
    """Two circles that touch in the middle, one flown to the left, the other to the right."""
    r, (x, y, _z) = mobility.radius_m, middle
    whole = _half_circle() + [math.pi + a for a in _half_circle()[1:-1]]
    right = [(x + r - r * math.cos(a), y + r * math.sin(a)) for a in whole]
    left = [(x - r + r * math.cos(a), y + r * math.sin(a)) for a in whole]
    return [mobility.at_height(corner) for corner in right + left]


def _half_circle() -> list[float]:
    return [math.pi * part / ARC_CORNERS for part in range(ARC_CORNERS + 1)]
