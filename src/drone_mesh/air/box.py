"""A box in the world. Pure geometry."""

from __future__ import annotations

import math
from dataclasses import dataclass

from drone_mesh.drone.flight_path import Point, Vector

# dB per surface crossed. brick: Sommer et al., "A Computationally Inexpensive Empirical Model of
# IEEE 802.11p Radio Shadowing in Urban Environments", WONS 2011, the defaults of Veins. The others:
# external walls in ns-3's building model, after COST 231.
CUT_DB = {"brick": 9.0, "wood": 4.0, "window": 7.0, "stone": 12.0, "concrete": 15.0}


@dataclass(frozen=True)
class Box:
    """A box, turned about its vertical axis by `yaw_rad`. Metres, world frame."""

    center: Vector
    size: Vector  # along its own x, y and z
    yaw_rad: float = 0.0
    cut_db: float = CUT_DB["brick"]

    @property
    def top_m(self) -> float:
        """Height of its upper side."""
        return self.center[2] + self.size[2] / 2

    def grown(self, metres: float) -> Box:
        """The same box, enlarged by this much on every side except the bottom."""
        x, y, z = self.size
        center = (self.center[0], self.center[1], self.center[2] + metres / 2)
        size = (x + 2 * metres, y + 2 * metres, z + metres)
        return Box(center, size, self.yaw_rad, self.cut_db)

    @property
    def corners(self) -> tuple[Point, ...]:
        """The four corners, seen from above."""
        x, y, _z = self.center
        long, wide = self.size[0] / 2, self.size[1] / 2
        cos, sin = math.cos(self.yaw_rad), math.sin(self.yaw_rad)
        return tuple(
            (x + cos * u - sin * v, y + sin * u + cos * v)
            for u, v in ((long, wide), (-long, wide), (-long, -wide), (long, -wide))
        )

    def chord(self, a: Vector, b: Vector) -> tuple[float, float] | None:
        """The part of the segment a..b inside the box, as fractions of a..b; None: it misses it.

        Kay and Kajiya's slab test (SIGGRAPH 1986) in the frame of the box.
        """
        start, end = self._to_own_frame(a), self._to_own_frame(b)
        enters, leaves = 0.0, 1.0
        for one, other, size in zip(start, end, self.size):
            half, step = size / 2, other - one
            if abs(step) < 1e-12:
                if abs(one) > half:
                    return None
                continue
            near, far = (-half - one) / step, (half - one) / step
            if near > far:
                near, far = far, near
            enters, leaves = max(enters, near), min(leaves, far)
            if enters >= leaves:
                return None
        return enters, leaves

    def contains(self, point: Vector) -> bool:
        """Whether a point is inside or on its surface."""
        return all(abs(c) <= s / 2 for c, s in zip(self._to_own_frame(point), self.size))

    def _to_own_frame(self, point: Vector) -> Vector:
        x, y = point[0] - self.center[0], point[1] - self.center[1]
        cos, sin = math.cos(self.yaw_rad), math.sin(self.yaw_rad)
        return (cos * x + sin * y, -sin * x + cos * y, point[2] - self.center[2])
