"""Boxes that stand in the world: what they do to radio links and to flights. Pure geometry."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Sequence

from drone_mesh.drone.flight_path import FlightPath, Vector
from drone_mesh.drone.goal import MAX_HEIGHT_M

# dB per surface crossed. brick: Sommer et al., "A Computationally Inexpensive Empirical Model of
# IEEE 802.11p Radio Shadowing in Urban Environments", WONS 2011, the defaults of Veins. The others:
# external walls in ns-3's building model, after COST 231.
CUT_DB = {"brick": 9.0, "wood": 4.0, "window": 7.0, "stone": 12.0, "concrete": 15.0}
METRE_DB = 0.4  # dB per metre inside, the same source as brick
NO_WAY = "obstacles leave no way there"  # why a goal is refused
CLEARANCE_M = 0.5  # our choice: a flight keeps so far from a box, above it and beside it


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
        """The same box, larger by this much on each side but the lower one."""
        x, y, z = self.size
        center = (self.center[0], self.center[1], self.center[2] + metres / 2)
        size = (x + 2 * metres, y + 2 * metres, z + metres)
        return Box(center, size, self.yaw_rad, self.cut_db)

    def chord(self, a: Vector, b: Vector) -> tuple[float, float] | None:
        """The part of the segment a..b inside the box, as shares of it; None: it misses the box.

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


@dataclass(frozen=True)
class Obstacles:
    """All boxes, and by which model they attenuate a link.

    A disc radio of range R has a margin of 10 n log10(R / d) dB at the distance d, with the path
    loss exponent n: the link is there while the boxes on its way take less than that.
    """

    boxes: Sequence[Box]
    blocks: bool = True  # any box on the way ends the link; else it damps by cut_db and metre_db
    metre_db: float = METRE_DB
    exponent: float = 2.0  # of the path loss; 2 is free space
    ceiling_m: float = MAX_HEIGHT_M  # no flight goes higher

    def loss_db(self, a: Vector, b: Vector) -> float:
        """What the boxes take from a signal from a to b, and the same from b to a."""
        if b < a:
            a, b = b, a  # one order: both directions give the same bits
        loss = 0.0
        for box in self.boxes:
            chord = box.chord(a, b)
            if chord is None:
                continue
            if self.blocks:
                return math.inf
            cuts = (chord[0] > 0.0) + (chord[1] < 1.0)
            loss += cuts * box.cut_db + (chord[1] - chord[0]) * math.dist(a, b) * self.metre_db
        return loss

    def margin_db(self, a: Vector, b: Vector, range_m: float) -> float:
        """How much more the link could bear; above 0 it is there."""
        distance_m = max(math.dist(a, b), 1e-3)  # two drones may share a point
        return 10 * self.exponent * math.log10(range_m / distance_m) - self.loss_db(a, b)

    def for_flights(self, half_width_m: float) -> Obstacles:
        """The same boxes, so much larger: for the centre of a body of this half width."""
        return replace(self, boxes=[box.grown(half_width_m) for box in self.boxes])

    def is_free(self, place: Vector) -> bool:
        """Whether a drone can be there."""
        return not any(box.contains(place) for box in self.boxes)

    def plan_flight(
        self, start: Vector, goal: Vector, start_s: float, speed_m_s: float
    ) -> FlightPath | None:
        """A flight over everything that is in the way; None where there is none.

        It climbs at its start and descends at its goal: with a box above one of these, or the goal
        inside one, or a box that reaches the ceiling, there is no way.
        """
        if not self.is_free(goal):
            return None
        across_m = -math.inf
        for _ in range(len(self.boxes) + 1):
            path = FlightPath(start, goal, start_s, speed_m_s, across_m)
            if max(path.above_start[2], path.above_goal[2]) > self.ceiling_m:
                return None
            if self._hits(start, path.above_start) or self._hits(path.above_goal, goal):
                return None
            in_the_way = [
                box.top_m
                for box in self.boxes
                if box.grown(CLEARANCE_M).chord(path.above_start, path.above_goal) is not None
            ]
            if not in_the_way:
                return path
            across_m = max(across_m, max(in_the_way) + CLEARANCE_M + 1e-6)
        return None

    def _hits(self, a: Vector, b: Vector) -> bool:
        return any(box.chord(a, b) is not None for box in self.boxes)
