"""The path of one flight: up, across, down; and the target that leads the drone along it."""

from __future__ import annotations

from typing import Sequence

from drone_mesh.drone.flight_path import Point, Vector
from drone_mesh.drone.location import Location

LEAD_S = 2.5  # the target ahead, in seconds of flight; with 1.5 ArduCopter is slow
SHORTEST_LEAD_M = 2.0  # more than the noise of a position
CORNER_M = 1.0  # distance at which a corner counts as passed


class Route:
    """Straight lines from here to the goal, across at one height.

    The target moves at the speed of the flight and waits for the drone: a drone whose link breaks
    ends at the last target, a few metres ahead of it, and never cuts a corner.
    """

    def __init__(
        self,
        start: Location,
        goal: Location,
        cross_at_m: float,
        lands: bool,
        speed_m_s: float,
        around: Sequence[Point] = (),
    ) -> None:
        """`cross_at_m` is the height in between; `around` are corners (x, y) in between.

        A start above `cross_at_m` first goes down. `lands` leaves the final descent to the
        autopilot.
        """
        height = max(cross_at_m, goal.height)
        between_ends = [Location.from_vector((x, y, height)) for x, y in around]
        corners = [start, start._replace(height=height), *between_ends]
        corners.append(goal._replace(height=height))
        if not lands:
            corners.append(goal)
        self._corners = corners
        self._next = 1  # the corner that the target moves to
        self.target = start  # the position to fly to now
        self._speed_m_s = speed_m_s
        self._lead_m = max(SHORTEST_LEAD_M, LEAD_S * speed_m_s)

    @property
    def end(self) -> Location:
        """The last corner."""
        return self._corners[-1]

    @property
    def ahead(self) -> list[Vector]:
        """The target, and the corners after it."""
        return [place.to_vector() for place in (self.target, *self._corners[self._next :])]

    def advance(self, here: Location, passed_s: float) -> bool:
        """Move the target for this time; returns whether the drone is at the end of the route."""
        budget_m = self._speed_m_s * passed_s
        while budget_m > 0.0:
            corner = self._corners[self._next]
            remaining_m = self.target.distance_m(corner)
            if remaining_m == 0.0:
                if here.distance_m(corner) > CORNER_M:
                    break  # it waits at the corner
                if self._next == len(self._corners) - 1:
                    return True
                self._next += 1
                continue
            if self.target.distance_m(here) > self._lead_m:
                break  # it waits for the drone
            step_m = min(budget_m, remaining_m)
            budget_m -= step_m
            if step_m == remaining_m:
                self.target = corner
            else:
                self.target = self.target.towards(corner, step_m)
        return False
