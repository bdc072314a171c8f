"""Mobility: the kind of motion of a fleet, its numbers and their bounds, and its area."""

from __future__ import annotations

import math
import numbers
import random
from dataclasses import dataclass, field
from typing import Iterator, Mapping, NamedTuple, Sequence, Tuple, cast

from drone_mesh.arguments import MOST
from drone_mesh.drone.flight_path import Point, Vector
from drone_mesh.drone.goal import MAX_HEIGHT_M
from drone_mesh.errors import ConfigurationError


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


Knot = Tuple[float, float, float, float]  # t (s), x, y, z (m)


@dataclass(frozen=True)
class Mobility:
    """The motion of a fleet: its kind and numbers. Which numbers a kind uses: docs/motion.md."""

    kind: str = "none"
    speed_m_s: tuple[float, float] = (0.3, 0.3)  # least and greatest
    pause_s: float = 0.0  # at each way-point
    height_m: float = 0.0  # of all flights
    share: float = 1.0  # of the drones; they are drawn. trace: those that it names, instead
    gateways: bool = False  # move as well
    steady: bool = True  # random_waypoint: from its steady state on; False: from where drones stand
    climbs: bool = False  # random_waypoint: each leg by the document's profile
    cruise_height_m: float = MAX_HEIGHT_M  # ceiling of legs that climb
    alpha: float = 0.85  # gauss_markov: memory, 0 (none) to 1 (straight ahead)
    update_s: float = 1.0  # gauss_markov: between two draws
    groups: int = 4
    radius_m: float = 5.0  # of a group, of the half circles of an oval, of the circles of an eight
    lanes: int = 6  # patrol over the area
    waypoints: Sequence[Point] = ()  # patrol: a loop instead of lanes
    knots: Mapping[int, Sequence[Knot]] = field(default_factory=dict)  # trace, by drone

    @property
    def moves_over_area(self) -> bool:
        """Whether the area, and not the drones' places or given points, says where they fly."""
        return self.kind in ("random_waypoint", "gauss_markov", "group") or (
            self.kind == "patrol" and not self.waypoints
        )

    @property
    def mean_speed_m_s(self) -> float:
        """The middle of the range."""
        return sum(self.speed_m_s) / 2

    def at_height(self, point: Sequence[float]) -> Vector:
        """A point (x, y) at the height of the flights."""
        return point[0], point[1], self.height_m


def check(mobility: Mobility) -> None:
    """Raise ConfigurationError for numbers that no model can use."""
    for name, is_right, rule in _rules(mobility):
        if not is_right:
            raise ConfigurationError(
                f"invalid mobility {name} {getattr(mobility, name)}: must be {rule}"
            )
    for node, knots in mobility.knots.items():
        if not knots or not all(_is_tuple(knot, 4) for knot in knots):
            problem = "must be t, x, y and z, finite numbers, once or more"
        elif not all(knot[0] >= before[0] for before, knot in zip(knots, knots[1:])):
            problem = "t must not fall"
        else:
            continue
        raise ConfigurationError(f"invalid mobility knots of drone {node}: {problem}")


def _rules(mobility: Mobility) -> Iterator[tuple[str, bool, str]]:
    """For each number: its name, whether it is valid, and what it has to be."""
    speeds = mobility.speed_m_s
    are_right = _is_tuple(speeds, 2) and 0 < speeds[0] <= speeds[1]
    yield "speed_m_s", are_right, "two speeds above 0, the lower first, such as (0.3, 0.3)"
    yield "share", _is_in(0, mobility.share, 1), "0..1"
    yield "alpha", _is_in(0, mobility.alpha, 1), "0..1"
    yield "pause_s", _is_in(0, mobility.pause_s), "0 or more"
    yield "update_s", _is_in(0, mobility.update_s) and mobility.update_s > 0, "above 0"
    yield "radius_m", _is_in(0, mobility.radius_m) and mobility.radius_m > 0, "above 0"
    for name in ("groups", "lanes"):
        count = getattr(mobility, name)
        yield name, isinstance(count, int) and count >= 1, "a whole number, 1 or more"
    height_m, ceiling_m, most_m = mobility.height_m, mobility.cruise_height_m, MAX_HEIGHT_M
    yield "height_m", _is_in(0, height_m, most_m), f"0..{most_m:g}"
    is_above = _is_in(height_m, ceiling_m, most_m)
    yield "cruise_height_m", is_above, f"from height_m, {height_m:g}, to {most_m:g}"
    corners = mobility.waypoints
    are_pairs = all(_is_tuple(corner, 2) for corner in corners)
    are_right = are_pairs and len(set(map(tuple, corners))) != 1
    yield "waypoints", are_right, "pairs x, y of finite numbers, two different places or more"


def _is_in(low: float, value: object, high: float = MOST) -> bool:
    """Whether `value` is a number in this range."""
    return isinstance(value, numbers.Real) and low <= cast(float, value) <= high


def _is_tuple(values: object, length: int) -> bool:
    """Whether these are `length` finite numbers."""
    return (
        isinstance(values, Sequence)
        and len(values) == length
        and all(_is_in(-MOST, value) for value in values)
    )


def check_area(mobility: Mobility, area: Area) -> None:
    """Raise ConfigurationError if the drones of this motion cannot move in this area."""
    problem = None
    if not _is_tuple(area, 4) or min(area.width_m, area.depth_m) < 0:
        problem = "must have finite numbers, its width and depth 0 or more"
    elif mobility.kind == "gauss_markov" and not area.width_m * area.depth_m:
        problem = "gauss_markov needs a width and a depth above 0"  # or it reflects for ever
    elif mobility.moves_over_area and not area.diagonal_m:
        problem = f"{mobility.kind} needs a width or a depth above 0"
    if problem is not None:
        x, y, width_m, depth_m = area
        raise ConfigurationError(
            f"invalid area {width_m:g} x {depth_m:g} m at ({x:g}, {y:g}): {problem}"
        )
