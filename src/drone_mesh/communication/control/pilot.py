"""The drone as the mesh sees it: its position and its flight (docs/repair.md, "Flight")."""

from __future__ import annotations

import math

from drone_mesh.communication.events.complaints import Complaints
from drone_mesh.communication.timing import (
    FLIGHT_POSITION_PERIOD_S,
    LANDED_WITHIN_M,
    Deadlines,
    Due,
)
from drone_mesh.drone.flight_path import SPEED_M_S
from drone_mesh.drone.goal import check_goal
from drone_mesh.drone.interfaces import IDroneEngine
from drone_mesh.drone.location import Location
from drone_mesh.errors import GoalRefused, LocationUnknown

STANDS_STILL_WITHIN_M = 1e-3  # far below what a drone flies in a second
ASKS_WITHOUT_ANSWER = 10  # then the mesh continues with an unknown position
SETS_OUT_WITHIN_S = 10.0  # a goal may reach a busy engine seconds later


class Flight:
    """One flight: its goal, and whether it has begun and ended."""

    def __init__(
        self, goal: Location, start: Location | None, replaced: Location | None, now_s: float
    ) -> None:
        """From `start` (None: unknown); `replaced`: the goal of a flight that it takes over from.

        A drone that rests at one of these may not have begun yet.
        """
        self.goal = goal
        self.may_begin = True  # its engine has not refused it
        self.did_not_set_out = False
        self._start = start
        self._replaced = replaced
        self._ordered_s = now_s
        self._last: Location | None = None
        self._was_flying = False  # as its engine says
        self._unanswered = 0

    def begin_anew(self, start: Location, now_s: float) -> None:
        """It goes another way from here, or will not set out."""
        self._start, self._last, self._ordered_s = start, None, now_s

    def is_over(
        self, location: Location | None, is_flying: bool | None, can_fly: bool, now_s: float
    ) -> bool:
        """Process the drone's location (None: unknown); returns whether it has landed.

        Landed: the engine says that it flew and flies no longer. Where it says nothing
        (`is_flying` None): within 0.1 m of the goal, or not moving between two requests anywhere
        but where it began. A drone that does not set out has landed, too.
        """
        if is_flying:
            self._was_flying = True
            return False
        if self._was_flying:
            return True
        if location is None:
            self._unanswered += 1
            return self._unanswered >= ASKS_WITHOUT_ANSWER
        self._unanswered = 0
        if _is_at(location, self.goal):
            return True
        if is_flying is None:
            last, self._last = self._last, location
            if last is None or location.distance_m(last) >= STANDS_STILL_WITHIN_M:
                return False
            self._start = self._start or last
            if not (_is_at(location, self._start) or _is_at(location, self._replaced)):
                return True
        may_set_out = self.may_begin and can_fly
        self.did_not_set_out = not may_set_out or now_s >= self._sets_out_until_s(location)
        return self.did_not_set_out

    def _sets_out_until_s(self, location: Location) -> float:
        """Until when it may still set out: the nearer the goal, the sooner it would be there."""
        flies_s = location.distance_m(self.goal) / SPEED_M_S
        return self._ordered_s + SETS_OUT_WITHIN_S + min(flies_s, SETS_OUT_WITHIN_S)


def _is_at(location: Location, place: Location | None) -> bool:
    return place is not None and location.distance_m(place) <= LANDED_WITHIN_M


class Pilot:
    """Flies the drone of one node and watches the flight."""

    def __init__(
        self, node_id: int, engine: IDroneEngine, deadlines: Deadlines, complaints: Complaints
    ) -> None:
        self._node_id = node_id
        self._engine = engine
        self._deadlines = deadlines
        self._complaints = complaints
        self._flight: Flight | None = None
        self.goal: Location | None = None  # of the current flight
        self.departure: Location | None = None  # goal of an ordered flight that begins soon
        self._origin: Location | None = None  # start of the flight, or of the first of several
        self.distance_m = math.inf  # straight from there to the goal; infinity: not known
        self.flight_end = ""  # why the last flight ended short of its goal
        self._first: Location | None = None  # on the ground where it was seen first

    @property
    def home(self) -> Location | None:
        """Where the drone belongs on the ground; None: not known yet."""
        return self._engine.home() or self._first

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

    @property
    def destination(self) -> Location | None:
        """The goal of the flight that begins soon, or of the current one."""
        return self.departure or self.goal

    def check(self, goal: Location) -> None:
        """Raise GoalRefused if it cannot fly, or `goal` is out of bounds or outside a fence."""
        check_goal(*goal, self._engine.fences())
        why_not = self._engine.why_not_fly()
        if why_not:
            raise GoalRefused(f"drone {self._node_id} cannot fly: {why_not}")

    def obey(self, goal: Location) -> None:
        """Start an ordered flight, or change the goal of the current one.

        Raises GoalRefused, and keeps the current flight, if `check` or the engine refuses the goal.
        """
        self.departure = None
        self.check(goal)
        self._engine.set_goal(*goal)
        self._begin(goal)

    def step_back_to(self, goal: Location, lands: bool = False) -> None:
        """Start a repair flight, or the last one if it `lands`, or change its goal."""
        flight = self._begin(goal)
        try:
            check_goal(*goal, self._engine.fences())
            (self._engine.land_at if lands else self._engine.step_back_to)(*goal)
        except GoalRefused as error:  # the flight ends as soon as the drone stands still
            flight.may_begin = False
            self._complaints.add("goal refused", str(error), self._deadlines.now_s)

    def on_fence(self) -> None:
        """The fence has changed: a flight goes another way, or ends where the drone is."""
        flight, here, now_s = self._flight, self.place(), self._deadlines.now_s
        if flight is not None and here is not None:
            ends = here.to_vector(), flight.goal.to_vector()
            why_not = self._engine.fences().why_not(ends[1])
            flight.begin_anew(here, now_s)
            flight.may_begin = not why_not and self._engine.plan(*ends, now_s) is not None

    def _begin(self, goal: Location) -> Flight:
        here = self.location()
        if self._flight is None:
            self._origin = here
        self.distance_m = math.inf if self._origin is None else self._origin.distance_m(goal)
        self._flight = flight = Flight(goal, here, self.goal, self._deadlines.now_s)
        self.goal = goal
        self._ask_position_later()
        return flight

    def watch(self) -> bool:
        """Request the position; returns whether the flight is over."""
        assert self._flight is not None
        flight, engine, now_s = self._flight, self._engine, self._deadlines.now_s
        if not flight.is_over(self.location(), engine.is_flying(), engine.can_fly(), now_s):
            self._ask_position_later()
            return False
        did_not = flight.did_not_set_out
        self.flight_end = "the drone did not set out" if did_not else "the flight ended"
        self.forget_flight()
        return True

    def forget_flight(self) -> None:
        self._flight = self.goal = self.departure = None
        self._deadlines.set(Due.ASK_POSITION, math.inf)

    def _located(self) -> Location:
        location = self._engine.get_location()
        latitude, longitude, height = location
        if not math.isfinite(latitude + longitude + height):
            raise LocationUnknown(f"invalid position of the drone: {location}")
        self._first = self._first or location._replace(height=0.0)
        return location

    def _ask_position_later(self) -> None:
        now_s = self._deadlines.now_s
        self._deadlines.set(Due.ASK_POSITION, now_s + FLIGHT_POSITION_PERIOD_S)
