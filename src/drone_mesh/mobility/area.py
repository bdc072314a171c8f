"""Area: the rectangle in which drones move."""

from __future__ import annotations

import math
import random
from typing import NamedTuple

from drone_mesh.drone.flight_path import Vector


class Area(NamedTuple):
    """A rectangle, in metres of the world frame."""

    x: float  # of its lower left corner
    y: float
    width_m: float
    depth_m: float

    def point(self, rng: random.Random, height_m: float) -> Vector:
        """A point drawn uniformly, at this height."""
        return (
            self.x + rng.random() * self.width_m,
            self.y + rng.random() * self.depth_m,
            height_m,
        )

    def without_border(self, border_m: float) -> Area:
        """The area inside a border of this width; at least its middle."""
        across_m, along_m = (min(border_m, side / 2) for side in (self.width_m, self.depth_m))
        return Area(
            self.x + across_m,
            self.y + along_m,
            self.width_m - 2 * across_m,
            self.depth_m - 2 * along_m,
        )

    @property
    def diagonal_m(self) -> float:
        """The greatest distance of two points."""
        return math.hypot(self.width_m, self.depth_m)

    @property
    def mean_distance_m(self) -> float:
        """The mean distance of two uniform points (rectangle line picking; Santalo 1976)."""
        a, b = self.width_m, self.depth_m
        d = self.diagonal_m
        if not a or not b:
            return d / 3
        straight = a**3 / b**2 + b**3 / a**2 + d * (3 - a**2 / b**2 - b**2 / a**2)
        logs = b**2 / a * math.log((a + d) / b) + a**2 / b * math.log((b + d) / a)
        return (straight + 2.5 * logs) / 15
