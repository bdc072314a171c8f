"""DroneEngine: position and flight of one drone (docs/protocol.md, "World and flights")."""

from __future__ import annotations

import logging
from collections import deque
from typing import Callable, NamedTuple

from drone_mesh.air.obstacles import NO_WAY
from drone_mesh.communication.observer import MeshEventKind
from drone_mesh.drone.flight_path import SPEED_M_S, FlightPath, PlanFlight, Vector
from drone_mesh.drone.goal import check_goal
from drone_mesh.drone.interfaces import IDroneEngine, Location
from drone_mesh.errors import GoalRefused
from drone_mesh.world.interfaces import World

ARRIVED_M = 0.01  # on each axis

_log = logging.getLogger(__name__)


class DroneState(NamedTuple):
    """Where a drone was at the end of one step. Never changes, so any thread may keep it."""

    position: Vector  # of the box's centre, metres, world frame: what DroneInfo carries
    path: FlightPath | None  # the flight it is on; None: it stands (or hovers) still
    now_s: float  # simulated time of the last change

    @property
    def is_flying(self) -> bool:
        return self.path is not None


StateListener = Callable[[DroneState], None]
"""Is called in the world's thread, inside a step: be quick and do not step the world."""

EngineObserver = Callable[[MeshEventKind, float, str], None]
"""Is called like a StateListener, with what happened, the simulated time, and a few words."""


class DroneEngine(IDroneEngine):
    """Flight path and pose of one drone.

    The pose belongs to the world's thread. `set_goal`, `state` and `get_location` may be used by
    any thread: a goal is queued and takes effect in the next step; the other two read the snapshot
    of the last one.
    """

    def __init__(
        self,
        world: World,
        box: int,
        centre: Vector,
        half_height_m: float,
        plan_flight: PlanFlight = FlightPath,
    ) -> None:
        """`box` is the drone's body in `world`, `centre` where that is now.

        `plan_flight` is asked for every flight, of the body's centre.
        """
        self._world = world
        self._box = box
        self._half_height_m = half_height_m
        self._plan_flight = plan_flight
        self._goals: deque[Vector] = deque()  # filled by any thread, emptied by the world's
        self._followed: Vector | None = None  # set by any thread, taken by the world's
        self._listeners: list[StateListener] = []
        self._observers: list[EngineObserver] = []
        self._state = DroneState(centre, None, world.now_s)
        self._has_left = False  # its body is not in the world any more

    @property
    def state(self) -> DroneState:
        """The drone after the last step in which it moved."""
        return self._state

    @property
    def crashed(self) -> bool:
        """Whether a hard hit has ended its flights for good."""
        return False

    def observe(self, observer: EngineObserver) -> None:
        """Call `observer` when something happens to the drone. World's thread."""
        self._observers.append(observer)

    def _note(self, kind: MeshEventKind, detail: str = "") -> None:
        for observer in self._observers:
            observer(kind, self._world.now_s, detail)

    @property
    def is_flat(self) -> bool:
        """Whether its battery feeds nothing any more, so that its node is off too."""
        return False

    def add_listener(self, listener: StateListener) -> None:
        """Call `listener` with the new state in each step that moves the drone.

        The last call of a flight has no path any more. World's thread.
        """
        self._listeners.append(listener)

    def leave(self) -> None:
        """Take the body out of the world; goals change nothing any more. World's thread."""
        self._has_left = True
        self._listeners.clear()
        self._observers.clear()
        self._world.remove_box(self._box)

    def set_goal(self, latitude: float, longitude: float, height: float) -> None:
        """Fly to this place (metres, world frame, height of the underside). Returns at once.

        The goal it already flies to, or already stands on, changes nothing; any other one replans
        the flight from where the drone is. Raises GoalRefused for NaN, infinity, places out of
        bounds, and where obstacles leave no way.
        """
        check_goal(latitude, longitude, height)
        goal = Location(latitude, longitude, height + self._half_height_m).to_vector()
        if self._plan(self._state.position, goal, self._world.now_s) is None:
            raise GoalRefused(f"{NO_WAY}: x {longitude:g} m, y {latitude:g} m, z {height:g} m")
        self._goals.append(goal)
        self._world.wake(self)

    def follow(self, centre: Vector) -> None:
        """Stand at this place from the next step on: another node flies the drone. Any thread."""
        self._followed = centre
        self._world.wake(self)

    def get_location(self) -> Location:
        """Where the underside is, in metres, after the last step. Never raises LocationUnknown."""
        x, y, z = self._state.position
        return Location.from_vector((x, y, z - self._half_height_m))

    def step(self, now_s: float) -> bool:
        """Take the goals that wait, fly on to `now_s`; True while in flight. For the world."""
        return not self._has_left and self._take_turn(now_s)

    def _take_turn(self, now_s: float) -> bool:
        while self._goals:
            self._take_goal(self._goals.popleft(), now_s)
        followed, self._followed = self._followed, None
        if followed is not None:
            self._move(followed, None, now_s)
        path = self._state.path
        if path is None:
            return False
        position = path.position_at(now_s)
        # Only a drone that comes down can arrive: a flight straight up passes its goal on the way.
        if path.is_descending(now_s) and _is_close(position, path.goal):
            position, path = path.goal, None
        self._move(position, path, now_s)
        return path is not None

    def _move(self, position: Vector, path: FlightPath | None, now_s: float) -> None:
        self._world.move_box(self._box, position)
        self._tell(position, path, now_s)

    def _tell(self, position: Vector, path: FlightPath | None, now_s: float) -> None:
        self._state = DroneState(position, path, now_s)
        for listener in self._listeners:
            listener(self._state)

    def _take_goal(self, goal: Vector, now_s: float) -> None:
        position, path, _ = self._state
        if _is_close(goal, position if path is None else path.goal):
            return
        path = self._plan(position, goal, now_s)
        if path is None:  # it has moved since the goal was accepted
            _log.warning("box %d stays: obstacles leave no way to %s", self._box, goal)
            return
        self._state = DroneState(position, path, now_s)
        _log.debug("box %d flies from %s to %s", self._box, position, goal)

    def _plan(self, start: Vector, goal: Vector, now_s: float) -> FlightPath | None:
        return self._plan_flight(start, goal, now_s, SPEED_M_S)


def _is_close(place: Vector, other: Vector) -> bool:
    return all(abs(a - b) <= ARRIVED_M for a, b in zip(place, other))
