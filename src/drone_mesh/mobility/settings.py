"""Mobility: the kind of motion of a fleet and its numbers."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Mapping, Sequence, Tuple

from drone_mesh.drone.flight_path import Point, Vector
from drone_mesh.drone.goal import MAX_HEIGHT_M

Knot = Tuple[float, float, float, float]  # t (s), x, y, z (m)


@dataclass(frozen=True)
class Mobility:
    """What moves, how, and how fast. Which numbers a kind uses: docs/motion.md."""

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
