"""A drone without a world: it flies on the virtual clock; pilots; what it knows of its place."""

from __future__ import annotations

import functools
import math
import random
from dataclasses import dataclass
from typing import Any, Callable, Iterable, Mapping, Optional

import numpy as np

from drone_mesh.air.obstacles import Obstacles, no_path
from drone_mesh.drone.battery import LAND_AT_PERCENT, Battery
from drone_mesh.drone.fence import Fence
from drone_mesh.drone.flight_path import SPEED_M_S, FlightPath, PlanFlight, Vector
from drone_mesh.drone.goal import check_goal
from drone_mesh.drone.interfaces import IDroneEngine
from drone_mesh.drone.location import Location
from drone_mesh.errors import ConfigurationError, GoalRefused, LocationUnknown
from drone_mesh.inprocess.clock import Clock
from drone_mesh.inprocess.interfaces import IInProcessAir
from drone_mesh.mobility import Segment, Track

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
        fence: Fence = Fence(),  # noqa: B008 (frozen)
    ) -> None:
        """`on_flight` is called with True at the start of a flight and with False at its end."""
        self.fence = fence
        self._why_not_fly = why_not_fly
        self._clock = clock
        self._place = self.home_place = start
        self.path: FlightPath | None = None  # of the current flight; None while at rest
        self._on_flight = on_flight
        self.under_pilot = False  # until an order ends the pilot's flight
        self._observers: list[OnPath] = []
        self.speed_m_s = SPEED_M_S  # of its next flight; experiments with wind change it
        # Returns None if there is no path; the drone then stays. Obstacles replace this planner.
        self.plan_flight: PlanFlight = FlightPath
        self.refused = 0  # goals without a path
        self.battery: Battery | None = None  # None: it never runs low; experiments use it up
        if fence:
            self.plan_flight = Obstacles((), fence=fence).plan_flight

    def set_goal(self, latitude: float, longitude: float, height: float) -> None:
        """Fly there, if it can. Raises GoalRefused for a goal out of bounds or without a path."""
        check_goal(latitude, longitude, height)
        if not self.why_not_fly():
            self.fly_to(Location(latitude, longitude, height))

    def fly_to(self, place: Location) -> None:
        """Like set_goal, whatever the battery has left."""
        here, goal = self.get_location(), place.to_vector()
        if goal == (self.path.goal if self.path else here.to_vector()):
            return
        plan = self.plan_flight(here.to_vector(), goal, self._clock.now_s, self.speed_m_s)
        if plan is None:
            self.refused += 1
            raise GoalRefused(self.fence.why_not(goal) or no_path(self.fence))
        self.under_pilot = False
        if self.path is None:
            self._on_flight(True)
        self._set_out(plan)

    def _set_out(self, plan: FlightPath) -> None:
        before, self.path = self.path, plan
        self._clock.call_at(self._clock.now_s + plan.duration_s, self._arrive, plan)
        for observer in self._observers:
            observer(before, plan)

    def plan(self, start: Vector, goal: Vector, now_s: float) -> FlightPath | None:
        """Round its fence, if it has one."""
        if not self.fence:
            return super().plan(start, goal, now_s)
        return self.plan_flight(start, goal, now_s, self.speed_m_s)

    def keep_to(self, fence: Fence) -> None:
        """Keep this fence from now on: a flight that would break it goes another way, or ends."""
        self.fence, path, now_s = fence, self.path, self._clock.now_s
        self.plan_flight = Obstacles((), fence=fence).plan_flight
        here = self.get_location()
        if path is None or not fence.why_not_straight([here.to_vector(), *path.ahead(now_s)]):
            return
        plan = self.plan_flight(here.to_vector(), path.goal, now_s, self.speed_m_s)
        if plan is None:
            self._place, self.path = here, None
            self._on_flight(False)
        else:
            self._set_out(plan)

    def observe(self, observer: OnPath) -> None:
        """Tell this observer of each flight from now on."""
        self._observers.append(observer)

    def put(self, place: Location) -> None:
        """Move the drone to a place where its pilot has flown it."""
        self._place = place

    def fall(self) -> None:
        """Its motors have stopped: it lies where it was above."""
        self._place, was_flying = self.get_location()._replace(height=0.0), self.path is not None
        self.path = None
        if was_flying:
            self._on_flight(False)

    def why_not_fly(self) -> str:
        """The reason given at creation, or its battery."""
        percent = self.battery_percent()
        if percent is not None and percent <= LAND_AT_PERCENT:
            return f"battery at {percent:.0f} %"
        return self._why_not_fly

    def battery_percent(self) -> float | None:
        return None if self.battery is None else self.battery.percent

    def home(self) -> Location:
        return self.home_place

    def get_location(self) -> Location:
        """Its position now. Never raises."""
        if self.path is None:
            return self._place
        return Location.from_vector(self.path.position_at(self._clock.now_s))

    def _arrive(self, path: FlightPath) -> None:
        if path is self.path:  # not replanned in flight
            self._place = Location.from_vector(path.goal)
            self.path = None
            self._on_flight(False)


CORRELATED_S = 10.0  # the error of a receiver drifts; after this time it is another one


@dataclass(frozen=True)
class PositionErrors:
    """The errors of the positions that the mesh software gets; flights and links are exact."""

    sigma_m: float = 0.0  # standard deviation along x and along y
    outliers: float = 0.0  # share of positions that are wrong by `outlier_m` in some direction
    outlier_m: float = 0.0
    known: bool = True  # False: no drone knows its position

    @property
    def none(self) -> bool:
        """Whether positions are exact."""
        return self.known and not self.sigma_m and not self.outliers


class PositionReceiver(IDroneEngine):
    """A drone whose position the mesh learns from a receiver with errors."""

    def __init__(
        self, drone: InProcessDrone, clock: Clock, errors: PositionErrors, rng: random.Random
    ) -> None:
        self._drone, self._clock, self._errors, self._rng = drone, clock, errors, rng
        self._error_m = (self._drawn(), self._drawn())
        self._drawn_s = 0.0

    @property
    def fence(self) -> Fence:  # type: ignore[override]
        return self._drone.fence

    def set_goal(self, latitude: float, longitude: float, height: float) -> None:
        self._drone.set_goal(latitude, longitude, height)

    def plan(self, start: Vector, goal: Vector, now_s: float) -> FlightPath | None:
        return self._drone.plan(start, goal, now_s)

    def why_not_fly(self) -> str:
        return self._drone.why_not_fly()

    def battery_percent(self) -> float | None:
        return self._drone.battery_percent()

    def home(self) -> Location:
        return self._drone.home()

    def get_location(self) -> Location:
        if not self._errors.known:
            raise LocationUnknown("no position receiver")
        place = self._drone.get_location()
        x_m, y_m = self._drifted()
        if self._rng.random() < self._errors.outliers:
            angle = self._rng.uniform(-math.pi, math.pi)
            x_m += self._errors.outlier_m * math.cos(angle)
            y_m += self._errors.outlier_m * math.sin(angle)
        return Location(place.latitude + y_m, place.longitude + x_m, place.height)

    def _drifted(self) -> tuple[float, float]:
        """The error now: normally distributed, and correlated over CORRELATED_S."""
        now_s = self._clock.now_s
        kept = math.exp(-(now_s - self._drawn_s) / CORRELATED_S)
        fresh = math.sqrt(1.0 - kept**2)
        x_m, y_m = (kept * before + fresh * self._drawn() for before in self._error_m)
        self._error_m, self._drawn_s = (x_m, y_m), now_s
        return self._error_m

    def _drawn(self) -> float:
        return self._rng.gauss(0.0, self._errors.sigma_m)


STEP_S = 0.1  # positions at 10 Hz, as a GPS receiver gives them
_LOCATION: Any = functools.partial(tuple.__new__, Location)  # as Location._make, but faster


class Pilots:
    """Drones of a network that move as their tracks say, in steps of STEP_S.

    The mesh of a drone learns nothing but its position. A flight order ends the pilot's flight: the
    drone flies to its goal and stays there.
    """

    def __init__(
        self,
        clock: Clock,
        air: IInProcessAir,
        drones: Mapping[int, InProcessDrone],
        tracks: Mapping[int, Track],
    ) -> None:
        """From now on these drones are where their tracks say, which begin at time 0.

        Raises ConfigurationError for a track of a drone that there is not.
        """
        unknown = sorted(tracks.keys() - drones.keys())
        if unknown:
            raise ConfigurationError(f"drone {unknown[0]} has a track and is not in the network")
        self._clock, self._air = clock, air
        self._drones, self._tracks = drones, tracks
        for node in tracks:
            drones[node].under_pilot = True
        self._hold(sorted(tracks))
        self._step(None)

    @property
    def flying(self) -> list[int]:
        """The drones that still follow their tracks."""
        return [node for node in self._nodes if self._drones[node].under_pilot]

    def _hold(self, nodes: Iterable[int]) -> None:
        """Keep the current legs of these drones as arrays, one row each."""
        now_s = self._clock.now_s
        self._nodes = list(nodes)
        self._flown = [self._drones[node] for node in self._nodes]
        legs = [self._tracks[node].leg_at(now_s) for node in self._nodes]
        self._starts_s = np.array([leg.start_s for leg in legs])
        self._ends_s = np.array([leg.end_s for leg in legs])
        self._places = np.array([leg.start for leg in legs])
        self._velocities = np.array([leg.velocity for leg in legs])

    def _put(self, row: int, leg: Segment) -> None:
        self._starts_s[row], self._ends_s[row] = leg.start_s, leg.end_s
        self._places[row], self._velocities[row] = leg.start, leg.velocity

    def _step(self, _: object) -> None:
        now_s = self._clock.now_s
        if not all(drone.under_pilot for drone in self._flown):
            self._hold(self.flying)
        if not self._nodes:
            return
        ended: Any = np.flatnonzero(self._ends_s <= now_s).tolist()
        for row in ended:
            self._put(row, self._tracks[self._nodes[row]].leg_at(now_s))
        places = self._places + self._velocities * (now_s - self._starts_s)[:, None]
        rows: Any = places[:, [1, 0, 2]].tolist()  # y, x, z, as in a Location
        for drone, place in zip(self._flown, map(_LOCATION, rows)):
            drone.put(place)
        self._air.moved(self._nodes)
        self._clock.call_at(now_s + STEP_S, self._step, None)
