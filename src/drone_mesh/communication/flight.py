"""The drone as the mesh sees it: its position and its flight (docs/protocol.md, "Flight")."""

from __future__ import annotations

import math

from drone_mesh.communication.complaints import Complaints
from drone_mesh.communication.deadlines import Deadlines, Due
from drone_mesh.communication.timing import FLIGHT_POSITION_PERIOD_S, LANDED_WITHIN_M
from drone_mesh.drone.interfaces import IDroneEngine
from drone_mesh.drone.location import Location
from drone_mesh.errors import GoalRefused, LocationUnknown

STANDS_STILL_WITHIN_M = 1e-3  # our choice: far below what a drone flies in a second
ASKS_WITHOUT_ANSWER = 10  # our choice: then the mesh continues with an unknown position


class Flight:
    """One flight: its goal, and whether it is over."""

    def __init__(self, goal: Location) -> None:
        self.goal = goal
        self._last: Location | None = None
        self._unanswered = 0

    def is_over(self, location: Location | None) -> bool:
        """Process the drone's location (None: unknown); returns whether it has landed.

        Landed: within 0.1 m of the goal, or not moving between two requests.
        """
        if location is None:
            self._unanswered += 1
            return self._unanswered >= ASKS_WITHOUT_ANSWER
        self._unanswered = 0
        if location.distance_m(self.goal) <= LANDED_WITHIN_M:
            return True
        still = self._last is not None and location.distance_m(self._last) < STANDS_STILL_WITHIN_M
        self._last = location
        return still


class Pilot:
    """Flies the drone of one node and watches the flight."""

    def __init__(self, engine: IDroneEngine, deadlines: Deadlines, complaints: Complaints) -> None:
        self._engine = engine
        self._deadlines = deadlines
        self._complaints = complaints
        self._flight: Flight | None = None
        self._origin: Location | None = None  # start of the flight, or of the first of several

    @property
    def goal(self) -> Location | None:
        """The goal of the current flight; None without one."""
        flight = self._flight
        return flight.goal if flight is not None else None

    def location(self) -> Location | None:
        """The drone's position; None, with a log line, if it is unknown."""
        try:
            return self._located()
        except LocationUnknown as error:
            self._complaints.add("own location unknown", str(error), self._deadlines.now_s)
            return None

    def place(self) -> Location | None:
        """The drone's position; None, without a log line, if it is unknown."""
        try:
            return self._located()
        except LocationUnknown:
            return None

    def battery_percent(self) -> int | None:
        """The charge of its battery; None: unknown."""
        percent = self._engine.battery_percent()
        return None if percent is None else round(max(0.0, min(100.0, percent)))

    def why_not_fly(self) -> str:
        """Why the drone cannot fly to a goal now; empty if it can."""
        return self._engine.why_not_fly()

    def obey(self, goal: Location) -> None:
        """Start an ordered flight, or change the goal of the current one.

        Raises GoalRefused, and changes nothing, if the engine refuses the goal.
        """
        self._engine.set_goal(*goal)
        self._begin(goal)

    def step_back_to(self, goal: Location) -> None:
        """Start a repair flight, or change the goal of the current one."""
        self._begin(goal)
        try:
            self._engine.step_back_to(*goal)
        except GoalRefused as error:  # the flight then ends at the first position request
            self._complaints.add("goal refused", str(error), self._deadlines.now_s)

    def distance_m(self) -> float:
        """Straight distance from the start to the goal of the flight, m; infinity if unknown."""
        if self._flight is None or self._origin is None:
            return math.inf
        return self._origin.distance_m(self._flight.goal)

    def _begin(self, goal: Location) -> None:
        if self._flight is None:
            self._origin = self.location()
        self._flight = Flight(goal)
        self._ask_position_later()

    def watch(self) -> bool:
        """Request the position; returns whether the flight is over."""
        assert self._flight is not None
        location, is_flying = self.location(), self._engine.is_flying()
        is_over = self._flight.is_over(location) if is_flying is None else not is_flying
        if not is_over:
            self._ask_position_later()
            return False
        self.forget_flight()
        return True

    def forget_flight(self) -> None:
        """No longer watch the flight."""
        self._flight = None
        self._deadlines.set(Due.ASK_POSITION, math.inf)

    def _located(self) -> Location:
        location = self._engine.get_location()
        if not all(map(math.isfinite, location)):
            raise LocationUnknown(f"invalid position of the drone: {location}")
        return location

    def _ask_position_later(self) -> None:
        now_s = self._deadlines.now_s
        self._deadlines.set(Due.ASK_POSITION, now_s + FLIGHT_POSITION_PERIOD_S)
