"""The drone as the mesh sees it: its place and its flight (docs/protocol.md, "Flight")."""

from __future__ import annotations

import math

from drone_mesh.communication.complaints import Complaints
from drone_mesh.communication.deadlines import Deadlines, Due
from drone_mesh.communication.timing import FLIGHT_POSITION_PERIOD_S, LANDED_WITHIN_M
from drone_mesh.drone.interfaces import IDroneEngine, Location
from drone_mesh.errors import GoalRefused, LocationUnknown

STANDS_STILL_WITHIN_M = 1e-3  # our choice: far below what a drone flies in a second
ASKS_WITHOUT_ANSWER = 10  # our choice: then the position stays unknown, and the mesh goes on


class Flight:
    """One flight: its goal, and whether it is over."""

    def __init__(self, goal: Location) -> None:
        self.goal = goal
        self._last: Location | None = None
        self._unanswered = 0

    def is_over(self, location: Location | None) -> bool:
        """Take note of where the drone is (None: unknown); whether it has landed.

        Landed is within 0.1 m of the goal, or no longer moving between two questions.
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
    """Flies the drone of one node, and watches the flight."""

    def __init__(self, engine: IDroneEngine, deadlines: Deadlines, complaints: Complaints) -> None:
        self._engine = engine
        self._deadlines = deadlines
        self._complaints = complaints
        self._flight: Flight | None = None
        self._origin: Location | None = None  # of the flight; of several in a row: of the first

    @property
    def goal(self) -> Location | None:
        """Where the drone is flying to; None while it is not."""
        flight = self._flight
        return flight.goal if flight is not None else None

    def location(self) -> Location | None:
        """Where the drone is; None, with a line in the log, if it cannot say."""
        try:
            return self._located()
        except LocationUnknown as error:
            self._complaints.add("own location unknown", str(error), self._deadlines.now_s)
            return None

    def look(self) -> Location | None:
        """Where the drone is; None if it cannot say, for those who can do without."""
        try:
            return self._located()
        except LocationUnknown:
            return None

    def battery_percent(self) -> int | None:
        """The charge of its battery; None if that is not known."""
        percent = self._engine.battery_percent()
        return None if percent is None else round(max(0.0, min(100.0, percent)))

    def why_not_fly(self) -> str:
        """Why the drone would not fly to a goal now; empty while it would."""
        return self._engine.why_not_fly()

    def obey(self, goal: Location) -> None:
        """Start an ordered flight, or change the goal of the present one.

        Raises GoalRefused, and changes nothing, if the engine refuses the goal.
        """
        self._engine.set_goal(*goal)
        self._begin(goal)

    def step_back_to(self, goal: Location) -> None:
        """Start a flight for a repair, or change the goal of the present one."""
        self._begin(goal)
        try:
            self._engine.step_back_to(*goal)
        except GoalRefused as error:  # the flight is then over at the first look
            self._complaints.add("goal refused", str(error), self._deadlines.now_s)

    def distance_m(self) -> float:
        """Straight distance from where the drone last stood to its goal; infinity if unknown."""
        if self._flight is None or self._origin is None:
            return math.inf
        return self._origin.distance_m(self._flight.goal)

    def _begin(self, goal: Location) -> None:
        if self._flight is None:
            self._origin = self.location()
        self._flight = Flight(goal)
        self._ask_position_later()

    def watch(self) -> bool:
        """Look where the drone is; whether the flight is over now."""
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
