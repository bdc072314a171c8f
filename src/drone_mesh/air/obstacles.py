"""All boxes of the world: their effect on links, and flights past them and within the fence."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Iterator, Sequence

from drone_mesh.drone.fence import CLEAR_M, Fence, Rule, Turn
from drone_mesh.drone.flight_path import FlightPath, Point, Vector
from drone_mesh.drone.goal import MAX_HEIGHT_M
from drone_mesh.drone.way_round import way_across

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

    def meets(self, a: Vector, b: Vector) -> bool:
        """Whether it is in the way from a to b."""
        return self.chord(a, b) is not None

    def turns(self, _height_m: float) -> list[Turn]:
        """Where a way round it may turn."""
        return list(map(Turn, self.grown(BESIDE_M).corners))

    def contains(self, point: Vector) -> bool:
        """Whether a point is inside or on its surface."""
        return all(abs(c) <= s / 2 for c, s in zip(self._to_own_frame(point), self.size))

    def _to_own_frame(self, point: Vector) -> Vector:
        x, y = point[0] - self.center[0], point[1] - self.center[1]
        cos, sin = math.cos(self.yaw_rad), math.sin(self.yaw_rad)
        return (cos * x + sin * y, -sin * x + cos * y, point[2] - self.center[2])


METRE_DB = 0.4  # dB per metre inside, the same source as brick
NO_PATH = "no path past the obstacles"  # reason for refusing a goal


def no_path(fence: Fence) -> str:
    """The same, where there is a fence as well."""
    return f"{NO_PATH} and fence {fence.names}" if fence else NO_PATH


BOX_CLEARANCE_M = 0.5  # least distance between a flight and a box, above and beside it
ABOVE_M = BOX_CLEARANCE_M + 1e-6  # height above a box at which a flight is just clear of it
BESIDE_M = 0.01  # distance of a corner of the path from its box, so that it does not touch it


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
    cruise_m: float = math.inf  # height of the way across at most, unless it has to pass over a box
    fence: Fence = Fence()  # noqa: RUF009 (frozen)

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

    def for_flights(self, half_width_m: float, half_height_m: float) -> Obstacles:
        """The same for flights of the centre of a body with this half width and height (m)."""
        boxes = [box.grown(half_width_m) for box in self.boxes]
        return replace(self, boxes=boxes, fence=self.fence.raised(half_height_m))

    def is_free(self, place: Vector) -> bool:
        """Whether a drone can be at this position, and may."""
        return not (any(box.contains(place) for box in self.boxes) or self.fence.why_not(place))

    def plan_flight(
        self, start: Vector, goal: Vector, start_s: float, speed_m_s: float
    ) -> FlightPath | None:
        """The quickest flight over or round the obstacles, within the fence; None: there is none.

        It climbs at its start and descends at its goal, so there is no flight if a box is above
        either, or contains the goal. Nor is there one over a box that reaches the ceiling. It
        crosses lower than usual if only that is within the fence; from outside it first flies to
        the nearest place inside.
        """
        usual = FlightPath(start, goal, start_s, speed_m_s, ceiling_m=self.cruise_m)
        if not (self.boxes or self.fence):
            return usual
        if not self.is_free(goal):
            return None
        lower = (height_m - CLEAR_M for height_m in self.fence.ceilings)
        sinks = bool(self.fence.why_not(start))
        at = [
            usual,
            *(replace(usual, ceiling_m=h, sinks=sinks) for h in lower if h < self.cruise_m),
        ]
        flights = []
        for one in at:
            over = self._over(one)
            if over is not None:
                flights.append(over)
                if over.across_m == -math.inf:
                    return over  # nothing is in the way
        flights += [way for one in at for way in self._ways_round(one)]
        return min(flights, key=lambda way: way.duration_s) if flights else None

    def _over(self, usual: FlightPath) -> FlightPath | None:
        path = usual
        for _ in range(len(self.boxes) + len(self.fence.rules) + 1):
            if not self._rises_freely(path):
                return None
            in_the_way = self._met(path)
            if not in_the_way:
                return path
            top_m = max(one.top_m for one in in_the_way) + ABOVE_M
            path = replace(usual, across_m=max(path.across_m, top_m))
        return None

    def _ways_round(self, usual: FlightPath) -> Iterator[FlightPath]:
        """Flights at the usual height and just above each higher box on the path, lowest first."""
        lowest_m = max(usual.above_start[2], usual.above_goal[2])
        tops = {one.top_m + ABOVE_M for one in self._met(usual)} - {math.inf}
        wide = [box.grown(BOX_CLEARANCE_M) for box in self.boxes]
        for height_m in sorted({lowest_m, *(top for top in tops if top > lowest_m)}):
            corners = way_across(self.fence, wide, usual.start, usual.goal, height_m)
            if corners is not None:
                path = replace(usual, across_m=height_m, around=corners)
                if self._rises_freely(path):
                    yield path

    def _met(self, path: FlightPath) -> list[Box | Rule]:
        """What is on a straight path across, or too close to it."""
        a, b = path.above_start, path.above_goal
        high_m = max(a[2], b[2])  # a dynamic drone crosses there, a kinematic one in a slope
        level = (*a[:2], high_m), (*b[:2], high_m)
        return [
            *(box for box in self.boxes if box.grown(BOX_CLEARANCE_M).meets(a, b)),
            *(rule for rule in self.fence.rules if rule.meets(a, b) or rule.meets(*level)),
        ]

    def _rises_freely(self, path: FlightPath) -> bool:
        """Whether its climb and descent are free and stay below the ceiling."""
        if max(path.above_start[2], path.above_goal[2]) > self.ceiling_m:
            return False
        rules = self.fence.rules
        climb = (path.start, path.above_start), [r for r in rules if r.allows(path.start)]
        descent = (path.above_goal, path.goal), rules
        return not any(
            one.meets(*leg) for leg, kept in (climb, descent) for one in (*self.boxes, *kept)
        )
