"""A drone without a world: it flies its path on the virtual clock."""

from __future__ import annotations

import math
from typing import Callable, Optional

from drone_mesh.air.obstacles import NO_PATH
from drone_mesh.drone.flight_path import SPEED_M_S, FlightPath, PlanFlight
from drone_mesh.drone.goal import check_goal
from drone_mesh.drone.interfaces import IDroneEngine
from drone_mesh.drone.location import Location
from drone_mesh.errors import GoalRefused
from drone_mesh.inprocess.clock import Clock

OnPath = Callable[[Optional[FlightPath], FlightPath], None]
"""Called with the path so far (None: at rest) and the new one."""


class InProcessDrone(IDroneEngine):
    """The position of one drone, which flies like the drones of the world."""

    def __init__(
        self,
        clock: Clock,
        start: Location,
        on_flight: Callable[[bool], None],
        why_not_fly: str = "",
    ) -> None:
        """`on_flight` is called with True at the start of a flight and with False at its end."""
        self.flown_m = 0.0  # straight distance from start to goal of all flights, in metres
        self._why_not_fly = why_not_fly
        self._clock = clock
        self._place = start
        self.path: FlightPath | None = None  # of the current flight; None while at rest
        self._on_flight = on_flight
        self.under_pilot = False  # until an order ends the pilot's flight
        self._observers: list[OnPath] = []
        self.speed_m_s = SPEED_M_S  # of its next flight; experiments with wind change it
        # Returns None if there is no path; the drone then stays. Obstacles replace this planner.
        self.plan_flight: PlanFlight = FlightPath

    def set_goal(self, latitude: float, longitude: float, height: float) -> None:
        """Fly there, if it can. Raises GoalRefused for a goal out of bounds or without a path."""
        check_goal(latitude, longitude, height)
        if self._why_not_fly:
            return
        here = self.get_location()
        goal = Location(latitude, longitude, height).to_vector()
        if goal == (self.path.goal if self.path else here.to_vector()):
            return
        plan = self.plan_flight(here.to_vector(), goal, self._clock.now_s, self.speed_m_s)
        if plan is None:
            raise GoalRefused(NO_PATH)
        self.under_pilot = False
        if self.path is None:
            self._on_flight(True)
        else:
            self.flown_m += math.dist(self.path.start, here.to_vector())
        before, self.path = self.path, plan
        self._clock.call_at(self._clock.now_s + plan.duration_s, self._arrive, plan)
        for observer in self._observers:
            observer(before, plan)

    def observe(self, observer: OnPath) -> None:
        """Tell this observer of each flight from now on."""
        self._observers.append(observer)

    def put(self, place: Location) -> None:
        """Move the drone to a place where its pilot has flown it."""
        self._place = place

    def why_not_fly(self) -> str:
        """The reason given at creation."""
        return self._why_not_fly

    def get_location(self) -> Location:
        """Its position now. Never raises."""
        if self.path is None:
            return self._place
        return Location.from_vector(self.path.position_at(self._clock.now_s))

    def _arrive(self, path: FlightPath) -> None:
        if path is self.path:  # not replanned in flight
            self._place = Location.from_vector(path.goal)
            self.flown_m += math.dist(path.start, path.goal)
            self.path = None
            self._on_flight(False)
