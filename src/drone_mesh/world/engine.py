"""DroneEngine: position and flight of one drone (docs/ros.md, "World and flights")."""

from __future__ import annotations

import logging
import math
from collections import deque
from typing import Callable, NamedTuple, Sequence

from drone_mesh.air.obstacles import no_path
from drone_mesh.communication.events.observer import MeshEventKind
from drone_mesh.drone.battery import Endurance
from drone_mesh.drone.fence import Fence
from drone_mesh.drone.flight_path import SPEED_M_S, FlightPath, PlanFlight, Vector
from drone_mesh.drone.goal import check_goal
from drone_mesh.drone.interfaces import IDroneEngine
from drone_mesh.drone.location import Location
from drone_mesh.errors import GoalRefused
from drone_mesh.mobility.pilot import TrackPilot
from drone_mesh.world.worlds import World

ARRIVED_M = 0.01  # on each axis
PILOT_STEP_S = 0.1  # a pilot moves its drone ten times a second

_log = logging.getLogger(__name__)


class DroneState(NamedTuple):
    """The drone at the end of one step. Immutable, so any thread may keep it."""

    position: Vector  # of the box's centre, metres, world frame: what DroneInfo carries
    path: FlightPath | None  # the current flight; None: it is at rest or hovers
    now_s: float  # simulated time of the last change

    @property
    def is_flying(self) -> bool:
        return self.path is not None


StateListener = Callable[[DroneState], None]
"""Called in the world's thread, inside a step: must be quick and must not step the world."""

EngineObserver = Callable[[MeshEventKind, float, str], None]
"""Called like a StateListener with event, simulated time (s), and a short text."""


class DroneEngine(IDroneEngine):
    """Flight path and pose of one drone.

    The pose belongs to the world's thread. Any thread may use `set_goal`, `state` and
    `get_location`: a goal is queued and takes effect in the next step; the other two read the
    snapshot of the last step.
    """

    def __init__(
        self,
        world: World,
        box: int,
        centre: Vector,
        half_height_m: float,
        plan_flight: PlanFlight = FlightPath,
    ) -> None:
        """`box` is the drone's body in `world`, `centre` its current position.

        `plan_flight` plans each flight of the body's centre.
        """
        self._world = world
        self._box = box
        self._half_height_m = half_height_m
        self._plan_flight = plan_flight
        self._goals: deque[Vector] = deque()  # filled by any thread, emptied by the world's
        self._pilot: TrackPilot | None = None  # replaced by any thread, moved by the world's
        self._piloted_s = -math.inf  # when the pilot last moved the drone
        self._followed: Vector | None = None  # set by any thread, used by the world's
        self._listeners: list[StateListener] = []
        self._observers: list[EngineObserver] = []
        self._state = DroneState(centre, None, world.now_s)
        self.crashed = False  # a hard hit has ended its flights for good
        self._has_left = False  # its body has been removed from the world

    @property
    def state(self) -> DroneState:
        """The drone after the last step in which it moved."""
        return self._state

    def observe(self, observer: EngineObserver) -> None:
        """Call `observer` at each event of the drone. World's thread."""
        self._observers.append(observer)

    def _note(self, kind: MeshEventKind, detail: str = "") -> None:
        for observer in self._observers:
            observer(kind, self._world.now_s, detail)

    @property
    def is_flat(self) -> bool:
        """Whether the battery is empty, so that its node is off as well."""
        return False

    def endurance(self, _now_s: float) -> Endurance:
        """How long it can stay in the air, and its pad."""
        return Endurance()

    def add_listener(self, listener: StateListener) -> None:
        """Call `listener` with the new state in each step that moves the drone.

        The last call of a flight has no path. World's thread.
        """
        self._listeners.append(listener)

    def leave(self) -> None:
        """Remove the body from the world; later goals have no effect. World's thread."""
        self._has_left = True
        self._listeners.clear()
        self._observers.clear()
        self._world.remove_box(self._box)

    def set_goal(self, latitude: float, longitude: float, height: float) -> None:
        """Fly to this position (metres, world frame, height of the underside). Returns at once.

        A goal equal to the current goal or position changes nothing; any other goal replans the
        flight from the current position. Raises GoalRefused for NaN, infinity, positions out of
        bounds or outside the fence, and goals that obstacles or the fence make unreachable.
        """
        check_goal(latitude, longitude, height, self.fence)
        goal = Location(latitude, longitude, height + self._half_height_m).to_vector()
        if self._plan(self._state.position, goal, self._world.now_s) is None:
            where = f"x {longitude:g} m, y {latitude:g} m, z {height:g} m"
            raise GoalRefused(f"{no_path(self.fence)}: {where}")
        self._goals.append(goal)
        self._world.wake(self)

    def keep_to(self, fence: Fence) -> None:
        """Keep this fence, as its planner does: fly another way, or stay. World's thread."""
        self.fence = fence
        (position, path, _), now_s = self._state, self._world.now_s
        if path is None:
            return
        way = [position, *self._ahead(path, now_s)]
        why_not = fence.raised(self._half_height_m).why_not_straight(way)
        if why_not:
            plan = self._plan(position, path.goal, now_s)
            self._fly_anew(plan, position, now_s)
            if plan is None:
                self._note(MeshEventKind.GOAL_REFUSED, f"it stays where it is: {why_not}")

    def _ahead(self, path: FlightPath, now_s: float) -> Sequence[Vector]:
        """The corners that it still flies to."""
        return path.ahead(now_s)

    def _fly_anew(self, path: FlightPath | None, position: Vector, now_s: float) -> None:
        self._notify(position, path, now_s)

    def follow(self, centre: Vector) -> None:
        """Be at this position from the next step on; another node flies the drone. Any thread."""
        self._followed = centre
        self._world.wake(self)

    @property
    def pilot(self) -> TrackPilot | None:
        """The pilot that flies it between ordered flights; None: there is none now. Any thread."""
        pilot = self._pilot
        return None if pilot is None or pilot.has_arrived else pilot

    def fly_with(self, pilot: TrackPilot | None) -> None:
        """Let this pilot fly it from the next step on, or nobody. Any thread."""
        self._pilot = pilot
        self._world.wake(self)

    def pause_pilot(self, paused: bool) -> None:
        """Let the pilot stay, or fly on. Any thread."""
        pilot = self._pilot
        if pilot is not None:
            (pilot.pause if paused else pilot.resume)()
            self._world.wake(self)

    def get_location(self) -> Location:
        """The underside's position after the last step, in metres. Never raises LocationUnknown."""
        x, y, z = self._state.position
        return Location.from_vector((x, y, z - self._half_height_m))

    def step(self, now_s: float) -> bool:
        """Apply waiting goals, fly on to `now_s`; returns whether it flies. For the world."""
        return not self._has_left and self._take_turn(now_s)

    def _take_turn(self, now_s: float) -> bool:
        while self._goals:
            self._take_goal(self._goals.popleft(), now_s)
        followed, self._followed = self._followed, None
        if followed is not None:
            self._move(followed, None, now_s)
        path = self._state.path
        if path is None:
            return self._follow_pilot(now_s)
        position = path.position_at(now_s)
        # A drone has arrived only once it descends: a vertical ascent passes its goal on the way.
        if path.is_descending(now_s) and _is_close(position, path.goal):
            position, path = path.goal, None
        self._move(position, path, now_s)
        return path is not None

    def _follow_pilot(self, now_s: float) -> bool:
        pilot = self._pilot
        if pilot is None or pilot.paused:
            return False
        if now_s - self._piloted_s >= PILOT_STEP_S - self._world.tick_s / 2:
            self._piloted_s = now_s
            before = self.get_location().to_vector()
            x, y, z = self._piloted(pilot, before, now_s)
            if (x, y, z) != before:
                self._move((x, y, z + self._half_height_m), None, now_s)
        return True

    def _piloted(self, pilot: TrackPilot, held: Vector, now_s: float) -> Vector:
        """Where its pilot wants it instead of there; at the fence the pilot pauses."""
        place = pilot.move(held, now_s)
        why_not = self.fence.why_not_straight([held, place])
        if not why_not:
            return place
        self.pause_pilot(True)
        self._note(MeshEventKind.GOAL_REFUSED, f"its pilot pauses: {why_not}")
        return held

    def _move(self, position: Vector, path: FlightPath | None, now_s: float) -> None:
        self._world.move_box(self._box, position)
        self._notify(position, path, now_s)

    def _notify(self, position: Vector, path: FlightPath | None, now_s: float) -> None:
        self._state = DroneState(position, path, now_s)
        for listener in self._listeners:
            listener(self._state)

    def _take_goal(self, goal: Vector, now_s: float) -> None:
        position, path, _ = self._state
        if _is_close(goal, position if path is None else path.goal):
            return
        path = self._plan(position, goal, now_s)
        if path is None:  # it has moved since the goal was accepted
            _log.warning("box %d stays: %s to %s", self._box, no_path(self.fence), goal)
            return
        self.pause_pilot(True)
        self._state = DroneState(position, path, now_s)
        _log.debug("box %d flies from %s to %s", self._box, position, goal)

    def _plan(self, start: Vector, goal: Vector, now_s: float) -> FlightPath | None:
        return self._plan_flight(start, goal, now_s, SPEED_M_S)


def _is_close(place: Vector, other: Vector) -> bool:
    return all(abs(a - b) <= ARRIVED_M for a, b in zip(place, other))
