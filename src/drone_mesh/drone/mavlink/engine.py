"""MavlinkEngine: the drone of a node that has a MAVLink autopilot."""

from __future__ import annotations

import logging
import math
import threading
import time
from collections import deque

from drone_mesh.drone.fence import Fence
from drone_mesh.drone.geodesy import Origin
from drone_mesh.drone.goal import check_goal
from drone_mesh.drone.interfaces import IDroneEngine
from drone_mesh.drone.location import Location
from drone_mesh.drone.mavlink.limits import FlightLimits, Permissions
from drone_mesh.drone.mavlink.link import MavlinkLink
from drone_mesh.drone.mavlink.pilot import MavlinkPilot
from drone_mesh.drone.mavlink.pilot_status import PilotStatus
from drone_mesh.errors import GoalRefused, LocationUnknown

TICK_S = 0.05  # four ticks per target
STALE_S = 2.0  # an older status is no longer valid
LONGEST_STEP_S = 0.2  # four ticks of the engine; what is longer was not listening
ASLEEP_S = 1.0  # after so long the pilot may have chosen another mode unseen
LANDING_M_S = 0.5  # ArduPilot's LAND_SPEED; PX4's MPC_LAND_SPEED is 0.7
CATCH_UP_S = 0.5  # for its thread, when the whole program was given no time

_log = logging.getLogger(__name__)


class ListeningClock:
    """Time during which a program really listened to its autopilot.

    Runs with the machine's clock, except over gaps of the caller's, which count as one step. A busy
    machine may give a program no time for seconds. That is not the autopilot's silence: what was
    said meanwhile waits in the line, or nobody said anything because the whole machine stood still.
    """

    def __init__(self, machine_s: float) -> None:
        """Start at the machine's time."""
        self.now_s = machine_s
        self.slept_s = 0.0  # the latest step, if it was as long as ASLEEP_S; otherwise 0
        self._machine_s = machine_s

    def step(self, machine_s: float) -> None:
        """The caller has just read the line."""
        passed_s = max(0.0, machine_s - self._machine_s)
        self._machine_s = machine_s
        self.now_s += min(passed_s, LONGEST_STEP_S)
        self.slept_s = passed_s if passed_s >= ASLEEP_S else 0.0


class MavlinkEngine(IDroneEngine):
    """Any thread may call it; its own thread owns the link and the pilot, until `close`.

    After it is closed or dies, the drone does what its autopilot is configured to do without a
    ground station: docs/flying.md.
    """

    def __init__(
        self,
        node_id: int,
        address: str,
        origin: Origin,
        limits: FlightLimits,
        permissions: Permissions,
        fence: Fence = Fence(),  # noqa: B008 (frozen)
    ) -> None:
        """Open the link. Raises ConfigurationError if that fails."""
        self.fence = fence
        self._node_id = node_id
        self._origin = origin
        self._limits = limits
        self.least_percent = max(self.least_percent, limits.min_battery_percent)
        self._link = MavlinkLink(address)
        self._pilot = MavlinkPilot(node_id, origin, limits, permissions, self._link.send, fence)
        self._goals: deque[tuple[Location, bool, bool]] = deque()  # lands there; for a repair
        self._latest = (PilotStatus(), time.monotonic())
        self._missed: tuple[PilotStatus, float] | None = None  # was waited for in vain
        self._updated = threading.Event()
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, name=f"mavlink {node_id}", daemon=True)
        self._thread.start()

    def fences(self) -> Fence:
        return self._pilot.fences()

    def set_goal(self, latitude: float, longitude: float, height: float) -> None:
        """Fly there, and land if the height is 0. Raises GoalRefused with the reason."""
        why_not = self.status().why_not_fly
        self._queue_goal(Location(latitude, longitude, height), height <= 0.0, False, why_not)

    def step_back_to(self, latitude: float, longitude: float, height: float) -> None:
        """Fly there and hover: at --hover, or else at the drone's current height."""
        status = self.status()
        hover_m, goal = self._limits.hover_m, status.goal
        if goal is not None and goal[:2] == (latitude, longitude) and goal.height > 0.0:
            hover_m = goal.height  # asked again: it is there, or on its way
        elif hover_m is None:
            here = status.location
            in_air = here is not None and status.on_ground is False
            hover_m = (
                here.height
                if here is not None and in_air
                else self._limits.layer_height_m(self._node_id)
            )
        self._queue_goal(Location(latitude, longitude, hover_m), False, True, status.why_not_repair)

    def land_at(self, latitude: float, longitude: float, height: float) -> None:
        why_not = self.status().why_not_repair
        self._queue_goal(Location(latitude, longitude, height), True, True, why_not)

    def home(self) -> Location | None:
        return self.status().home

    def on_ground(self, here: Location) -> bool:
        """What the autopilot says."""
        return bool(self.status().on_ground)

    def seconds_between(self, start: Location, goal: Location) -> float:
        """Up to its layer, straight across, and down as slowly as autopilots land."""
        layer_m = max(start.height, self._limits.layer_height_m(self._node_id))
        flown_m = math.dist(start[:2], goal[:2]) + layer_m - start.height
        return flown_m / self._limits.speed_m_s + (layer_m - goal.height) / LANDING_M_S

    def get_location(self) -> Location:
        status = self.status()
        if status.location is None:
            raise LocationUnknown(status.location_trouble)
        return status.location

    def why_not_fly(self) -> str:
        return self.status().why_not_fly

    def why_not_repair(self) -> str:
        """Why it cannot fly for a repair: also if anybody else chose the mode that it is in."""
        return self.status().why_not_repair

    def why_ended(self) -> str:
        return self.status().ended

    def is_flying(self) -> bool:
        return bool(self._goals) or self.status().is_flying

    def battery_percent(self) -> float | None:
        return self.status().battery_percent

    def frame_digest(self) -> int:
        return self._origin.digest

    def status(self) -> PilotStatus:
        """The latest status of the drone; without a position if it is too old."""
        latest = self._latest
        if _is_stale(latest) and latest is not self._missed:
            # Who asks may have slept as long as the thread, and wakes before it: once it waits.
            self._updated.clear()
            if self._latest is latest and not self._updated.wait(CATCH_UP_S):
                self._missed = latest
            latest = self._latest
        if _is_stale(latest):
            silent = "the engine does not answer"
            return PilotStatus(
                location_trouble=silent, why_not_fly=silent, why_not_repair=silent, ended=silent
            )
        return latest[0]

    def close(self) -> None:
        self._ended.set()
        self._thread.join()

    def _queue_goal(self, goal: Location, lands: bool, for_repair: bool, why_not: str) -> None:
        if why_not:
            raise GoalRefused(f"the drone cannot fly: {why_not}")
        home = self.status().home
        if home is None:  # the status has become stale since
            raise GoalRefused("the drone cannot fly: its home is not known")
        self._limits.check(goal, home)
        check_goal(*goal, self.fences())
        self._goals.append((goal, lands, for_repair))

    def _run(self) -> None:
        clock, tick_due_s = ListeningClock(time.monotonic()), 0.0
        try:
            while not self._ended.is_set():
                messages = self._link.receive(TICK_S)
                clock.step(time.monotonic())
                for message in messages:
                    self._pilot.on_message(message, clock.now_s)
                if clock.slept_s:
                    _log.warning("node %d: asleep for %.1f s", self._node_id, clock.slept_s)
                    self._pilot.slept(clock.now_s)
                if clock.now_s >= tick_due_s or self._goals:
                    tick_due_s = clock.now_s + TICK_S
                    self._tick(clock.now_s)
        finally:
            self._link.close()

    def _tick(self, now_s: float) -> None:
        while self._goals:
            goal, lands, for_repair = self._goals[0]
            try:
                self._pilot.set_goal(goal, lands, now_s, for_repair)
            except GoalRefused as error:
                _log.warning("node %d: the goal is refused: %s", self._node_id, error)
            self._pilot.tick(now_s)
            self._publish(now_s)
            self._goals.popleft()
        self._pilot.tick(now_s)
        self._publish(now_s)

    def _publish(self, now_s: float) -> None:
        self._latest = (self._pilot.status(now_s), time.monotonic())
        self._updated.set()


def _is_stale(latest: tuple[PilotStatus, float]) -> bool:
    return time.monotonic() - latest[1] > STALE_S
