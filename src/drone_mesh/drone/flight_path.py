"""Geometry and timing of a flight (docs/ros.md, "World and flights")."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Callable, Optional, Sequence, Tuple

Vector = Tuple[float, float, float]  # x (longitude), y (latitude), z (up): metres, world frame
Point = Tuple[float, float]  # x and y of a Vector

SPEED_M_S = 2.0
CLIMB_ENDS_AT = 0.1  # share of the flight's duration
DESCENT_STARTS_AT = 0.9  # share of the flight's duration


def between(start: Vector, end: Vector, share: float) -> Vector:
    """The point at `share` (0..1) of the straight line from `start` to `end`."""
    return (
        start[0] + (end[0] - start[0]) * share,
        start[1] + (end[1] - start[1]) * share,
        start[2] + (end[2] - start[2]) * share,
    )


def nearest_share(start: Sequence[float], end: Sequence[float]) -> float:
    """How far along this line the point nearest to the origin lies, 0 to 1."""
    way = [b - a for a, b in zip(start, end)]
    length_2 = sum(step * step for step in way)
    if length_2 == 0.0:
        return 0.0
    return min(1.0, max(0.0, -sum(a * step for a, step in zip(start, way)) / length_2))


def ground_apart_m(a: Point, b: Point, c: Point, d: Point) -> float:
    """How near the straight ways from a to b and from c to d come to each other over ground."""

    def side(p: Point, q: Point, r: Point) -> float:
        return (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0])

    def away_m(p: Point, q: Point, r: Point) -> float:
        start, end = (q[0] - p[0], q[1] - p[1], 0.0), (r[0] - p[0], r[1] - p[1], 0.0)
        return math.hypot(*between(start, end, nearest_share(start, end)))

    if side(a, b, c) * side(a, b, d) < 0 and side(c, d, a) * side(c, d, b) < 0:
        return 0.0
    return min(away_m(a, c, d), away_m(b, c, d), away_m(c, a, b), away_m(d, a, b))


@dataclass(frozen=True)
class FlightPath:
    """One flight in straight lines: up, across, down.

    A flight over a straight distance d takes d / speed_m_s and climbs d / 2. The path is longer
    than d, so the drone flies faster than speed_m_s for most of it. If `across_m` requires a higher
    climb, or `around` a detour, the extra metres take additional time. Under a ceiling it climbs
    less, in the same time. On a detour the drone flies
    at one height, the greater one of the two ends.
    """

    start: Vector
    goal: Vector
    start_s: float  # when it leaves `start`, simulated seconds
    speed_m_s: float = SPEED_M_S
    across_m: float = -math.inf  # least height of the way across, to pass over obstacles
    around: tuple[Point, ...] = ()  # x, y: corners of a detour on the way across
    ceiling_m: float = math.inf  # height of the way across at most, unless it starts or ends higher
    sinks: bool = False  # if it starts above the ceiling, it first goes down to it
    duration_s: float = field(init=False)
    above_start: Vector = field(init=False)  # where it is at 10 %
    above_goal: Vector = field(init=False)  # where it is at 90 %

    def __post_init__(self) -> None:
        distance_m = math.dist(self.start, self.goal)
        climb_m = distance_m / 2
        usual = (self.start[2] + climb_m, self.goal[2] + climb_m)
        least_m = self.goal[2] if self.sinks else max(self.start[2], self.goal[2])
        ceiling_m = max(self.ceiling_m, least_m)
        heights = [max(min(height, ceiling_m), self.across_m) for height in usual]
        if self.around:
            heights = [max(heights)] * 2
        extra_m = sum(max(0.0, height - least) for height, least in zip(heights, usual))
        if self.around:
            over_ground = (self.start[:2], *self.around, self.goal[:2])
            extra_m += _length(over_ground) - math.dist(self.start[:2], self.goal[:2])
        derived = {
            "duration_s": (distance_m + extra_m) / self.speed_m_s,
            "above_start": (self.start[0], self.start[1], heights[0]),
            "above_goal": (self.goal[0], self.goal[1], heights[1]),
        }
        for name, value in derived.items():
            object.__setattr__(self, name, value)

    @property
    def across(self) -> tuple[Vector, ...]:
        """The corners of the way across, both ends included."""
        height_m = self.above_start[2]
        return (self.above_start, *((x, y, height_m) for x, y in self.around), self.above_goal)

    @property
    def waypoints(self) -> tuple[Vector, ...]:
        """The corners of the path, to draw it."""
        return (self.start, *self.across, self.goal)

    @property
    def ground_m(self) -> float:
        """The horizontal length of the path."""
        return _length([corner[:2] for corner in self.across])

    def ground_flown_m(self, now_s: float) -> float:
        """The horizontal distance flown until this time, in metres."""
        return self.ground_m * self._share_across(self.share_flown(now_s))

    def ahead(self, now_s: float) -> list[Vector]:
        """The corners still ahead at this time, the goal last."""
        share = self.share_flown(now_s)
        if share >= DESCENT_STARTS_AT:
            return [self.goal]
        left = self.across if share < CLIMB_ENDS_AT else self._left(self._share_across(share))
        return [*left, self.goal]

    def _left(self, share: float) -> tuple[Vector, ...]:
        """The corners of the way across that lie before this share of it."""
        flown_m = share * _length(self.across)
        passed = (_length(self.across[:count]) <= flown_m for count in range(1, len(self.across)))
        return self.across[sum(passed) :]

    def passes_m(self, place: Vector, now_s: float) -> float:
        """How near it comes to `place` from this time on, in metres."""
        corners = [self.position_at(now_s), *self.ahead(now_s)]
        away = [(x - place[0], y - place[1], z - place[2]) for x, y, z in corners]
        return min(
            math.hypot(*between(one, other, nearest_share(one, other)))
            for one, other in zip(away, away[1:])
        )

    def above_goal_s(self, height_m: float) -> float:
        """When it is this high above its goal on the way down, or begins that way, if lower."""
        down_m = self.above_goal[2] - self.goal[2]
        left = min(1.0, height_m / down_m) if down_m > 0.0 else 0.0
        return self.start_s + self.duration_s * (1.0 - left * (1.0 - DESCENT_STARTS_AT))

    @staticmethod
    def _share_across(share: float) -> float:
        """The share of the way across, at this share of the flight's time."""
        return min(1.0, max(0.0, (share - CLIMB_ENDS_AT) / (DESCENT_STARTS_AT - CLIMB_ENDS_AT)))

    def share_flown(self, now_s: float) -> float:
        """The elapsed share of the flight's time: 0.0 before the start, 1.0 from the end on."""
        if self.duration_s == 0.0:
            return 1.0
        return min(1.0, max(0.0, (now_s - self.start_s) / self.duration_s))

    def position_at(self, now_s: float) -> Vector:
        """The drone's position at this time: `start` before the flight, `goal` after it."""
        share = self.share_flown(now_s)
        if share >= 1.0:
            return self.goal
        if share < CLIMB_ENDS_AT:
            return between(self.start, self.above_start, share / CLIMB_ENDS_AT)
        if share < DESCENT_STARTS_AT:
            return _along(self.across, self._share_across(share))
        descent = (share - DESCENT_STARTS_AT) / (1.0 - DESCENT_STARTS_AT)
        return between(self.above_goal, self.goal, descent)

    def is_descending(self, now_s: float) -> bool:
        """Whether the last, vertical part has begun."""
        return self.share_flown(now_s) >= DESCENT_STARTS_AT


def _length(corners: Sequence[Sequence[float]]) -> float:
    return sum(math.dist(one, other) for one, other in zip(corners, corners[1:]))


def _along(corners: Sequence[Vector], share: float) -> Vector:
    """The point at `share` (0..1) of the length of these straight lines."""
    if len(corners) == 2:
        return between(corners[0], corners[1], share)
    left_m = share * _length(corners)
    for start, end in zip(corners, corners[1:]):
        leg_m = math.dist(start, end)
        if left_m <= leg_m > 0.0:
            return between(start, end, left_m / leg_m)
        left_m -= leg_m
    return corners[-1]


PlanFlight = Callable[[Vector, Vector, float, float], Optional[FlightPath]]
"""From start, goal, time (s) and speed (m/s) to a flight; None: no path."""
