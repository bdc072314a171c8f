"""All boxes of the world: their effect on links, and flights past them. Pure geometry."""

from __future__ import annotations

import heapq
import math
from dataclasses import dataclass, replace
from typing import Iterator, Sequence

from drone_mesh.drone.flight_path import FlightPath, Point, Vector
from drone_mesh.drone.goal import MAX_HEIGHT_M

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


METRE_DB = 0.4  # dB per metre inside, the same source as brick
NO_PATH = "no path past the obstacles"  # reason for refusing a goal
BOX_CLEARANCE_M = 0.5  # least distance between a flight and a box, above and beside it
ABOVE_M = BOX_CLEARANCE_M + 1e-6  # height above a box at which a flight is just clear of it
BESIDE_M = 0.01  # distance of a corner of the path from its box, so that it does not touch it
MOST_BOXES = 10  # on one path; the search time grows with the cube


@dataclass(frozen=True)
class Obstacles:
    """All boxes, and the model of their attenuation.

    A disc radio of range R has a margin of 10 n log10(R / d) dB at distance d, with path loss
    exponent n. A link exists while the boxes on its path attenuate it by less than that margin.
    """

    boxes: Sequence[Box]
    blocks: bool = True  # any box cuts the link; otherwise it attenuates by cut_db, metre_db
    metre_db: float = METRE_DB
    exponent: float = 2.0  # of the path loss; 2 is free space
    ceiling_m: float = MAX_HEIGHT_M  # no flight goes higher

    def loss_db(self, a: Vector, b: Vector) -> float:
        """Attenuation by the boxes between a and b, in dB; the same in both directions."""
        if b < a:
            a, b = b, a  # one order, so both directions give exactly the same result
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
        """The attenuation in dB that the link could still bear; above 0 the link exists."""
        distance_m = max(math.dist(a, b), 1e-3)  # two drones may share a point
        return 10 * self.exponent * math.log10(range_m / distance_m) - self.loss_db(a, b)

    def for_flights(self, half_width_m: float) -> Obstacles:
        """The same boxes, enlarged for the centre of a body with this half width (m)."""
        return replace(self, boxes=[box.grown(half_width_m) for box in self.boxes])

    def is_free(self, place: Vector) -> bool:
        """Whether a drone can be at this position."""
        return not any(box.contains(place) for box in self.boxes)

    def plan_flight(
        self, start: Vector, goal: Vector, start_s: float, speed_m_s: float
    ) -> FlightPath | None:
        """The quickest flight over or round the obstacles; None if there is none.

        It climbs at its start and descends at its goal, so there is no flight if a box is above
        either, or contains the goal. Nor is there one over a box that reaches the ceiling.
        """
        if not self.is_free(goal):
            return None
        over = self._over(start, goal, start_s, speed_m_s)
        if over is not None and over.across_m == -math.inf:
            return over  # nothing is in the way
        ways = [over, *self._ways_round(start, goal, start_s, speed_m_s)]
        flights = [way for way in ways if way is not None]
        return min(flights, key=lambda way: way.duration_s) if flights else None

    def _over(
        self, start: Vector, goal: Vector, start_s: float, speed_m_s: float
    ) -> FlightPath | None:
        across_m = -math.inf
        for _ in range(len(self.boxes) + 1):
            path = FlightPath(start, goal, start_s, speed_m_s, across_m)
            if not self._rises_freely(path):
                return None
            in_the_way = self._met(path)
            if not in_the_way:
                return path
            across_m = max(across_m, max(box.top_m for box in in_the_way) + ABOVE_M)
        return None

    def _ways_round(
        self, start: Vector, goal: Vector, start_s: float, speed_m_s: float
    ) -> Iterator[FlightPath]:
        """Flights at the usual height and just above each higher box on the path, lowest first."""
        usual = FlightPath(start, goal, start_s, speed_m_s)
        lowest_m = max(usual.above_start[2], usual.above_goal[2])
        tops = {box.top_m + ABOVE_M for box in self._met(usual)}
        wide = [box.grown(BOX_CLEARANCE_M) for box in self.boxes]
        for height_m in sorted({lowest_m, *(top for top in tops if top > lowest_m)}):
            corners = way_round(wide, start[:2], goal[:2], height_m)
            if corners is not None:
                path = FlightPath(start, goal, start_s, speed_m_s, height_m, corners)
                if self._rises_freely(path):
                    yield path

    def _met(self, path: FlightPath) -> list[Box]:
        """The boxes on a straight horizontal path, or too close to it."""
        return [
            box
            for box in self.boxes
            if box.grown(BOX_CLEARANCE_M).chord(path.above_start, path.above_goal) is not None
        ]

    def _rises_freely(self, path: FlightPath) -> bool:
        """Whether its climb and descent meet no box and stay below the ceiling."""
        if max(path.above_start[2], path.above_goal[2]) > self.ceiling_m:
            return False
        ends = ((path.start, path.above_start), (path.above_goal, path.goal))
        return not any(box.chord(a, b) is not None for box in self.boxes for a, b in ends)


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
