"""DynamicEngine: a drone moved by physics: mass, drag, wind, battery, collisions."""

from __future__ import annotations

import logging
import math
from typing import Sequence

from drone_mesh.air.obstacles import no_path
from drone_mesh.communication.events.observer import MeshEventKind
from drone_mesh.drone.battery import (
    FLAT,
    GRAVITY_M_S2,
    LAND_AT_PERCENT,
    READY_PERCENT,
    Battery,
    Crews,
    Endurance,
)
from drone_mesh.drone.flight_path import SPEED_M_S, FlightPath, PlanFlight, Vector
from drone_mesh.drone.location import Location
from drone_mesh.drone.route import Route
from drone_mesh.errors import GoalRefused
from drone_mesh.mobility.pilot import TrackPilot
from drone_mesh.world.body import BodyLimits, controller_force, drag, learnt_trim
from drone_mesh.world.engine import DroneEngine
from drone_mesh.world.worlds import PhysicalWorld

ARRIVED_M = 0.15
STANDS_M_S = 0.1
PILOT_LEAD_M = 1.0  # greatest distance of the place that a pilot wants it to hold
ON_GROUND_M = 0.02  # of its underside
AT_HOME_M = 0.5
ONE_PAD = 0  # of the crews: all places where drones start
MOVED_M = 1e-4  # a smaller movement is not reported
SETTLED_S = 0.1  # time after the last movement until its position is reported once more
STANDING_STEP_S = 0.1  # a drone that stands is looked at so often: only others can move it

_log = logging.getLogger(__name__)


class DynamicEngine(DroneEngine):
    """Like DroneEngine, but the body has mass, and physics decides where the flight ends.

    A hard hit ends its flights for good; so does an empty battery, once it has come down.
    """

    def __init__(
        self,
        world: PhysicalWorld,
        box: int,
        centre: Vector,
        half_height_m: float,
        wind: Vector = (0.0, 0.0, 0.0),
        limits: BodyLimits = BodyLimits(),  # noqa: B008 (frozen)
        plan_flight: PlanFlight = FlightPath,
        crews: Crews | None = None,
    ) -> None:
        """`box` is a body with a mass; `wind` blows everywhere, m/s.

        `crews` swap its battery while it stands where it is created, and it goes there when it
        runs low; None: it lands where it is.
        """
        super().__init__(world, box, centre, half_height_m, plan_flight)
        self._physics = world
        self._wind = wind
        self._limits = limits
        self._route: Route | None = None  # the current flight
        self._hover: Location | None = None  # the position that it holds
        self._velocity: Vector = (0.0, 0.0, 0.0)
        self._pushed: Vector | None = None  # speed that the last forces alone would have caused
        self._trim: Vector = (0.0, 0.0, 0.0)
        self._stepped_s = world.now_s
        self._battery = Battery(limits.power)
        self._home, self._crews = Location.from_vector(centre), crews
        self._was_flat = False
        self._settled = True
        self._stands = False  # on the ground, and nothing moved it lately
        self._held_s = 0.0  # how long an obstacle has held it in the air
        world.wake(self)

    def why_not_fly(self) -> str:
        if self.crashed:
            return "crashed"
        if self.battery_percent() <= LAND_AT_PERCENT:
            return f"battery at {self.battery_percent():.0f} %"
        return ""

    def battery_percent(self) -> float:
        return self._battery.percent

    def endurance(self, now_s: float) -> Endurance:
        if self._crews is None:
            return Endurance(self._battery.hover_left_s)
        home = self._home._replace(height=self._home.height - self._half_height_m).to_vector()
        pad = self._crews.in_words(self._box, ONE_PAD, now_s)
        return Endurance(self._battery.hover_left_s, home, pad)

    @property
    def is_flat(self) -> bool:
        return self._battery.percent == FLAT

    def is_flying(self) -> bool:
        return self._route is not None or bool(self._goals)

    def fly_with(self, pilot: TrackPilot | None) -> None:
        self._stands = False
        super().fly_with(pilot)

    def leave(self) -> None:
        """Like DroneEngine.leave; the crews go on with others."""
        super().leave()
        if self._crews is not None:
            self._crews.leave(self._box, ONE_PAD)

    def set_goal(self, latitude: float, longitude: float, height: float) -> None:
        """Like DroneEngine.set_goal. Also raises GoalRefused if the drone cannot fly."""
        why_not = self.why_not_fly()
        if why_not:
            raise GoalRefused(f"the drone cannot fly: {why_not}")
        super().set_goal(latitude, longitude, height)

    def _take_turn(self, now_s: float) -> bool:
        """After a step of physics: read position and speed, apply forces. Always continues."""
        soon_s = STANDING_STEP_S - self._world.tick_s / 2
        if self._stands and not self._goals and now_s - self._stepped_s < soon_s:
            return True
        passed_s, self._stepped_s = now_s - self._stepped_s, now_s
        position, velocity = self._physics.body_state(self._box)
        if self._pushed is not None:
            self._check_hits(velocity, passed_s)
        self._velocity = velocity
        while self._goals:
            self._begin(Location.from_vector(self._goals.popleft()), position, now_s)
        self._follow_pilot(now_s)
        in_air = self._route is not None or self._hover is not None
        if in_air and not self.crashed:
            self._fly(position, passed_s)
        else:
            self._pushed = None
            self._drain(passed_s, None)
        self._ask_for_battery(position, now_s)
        path = self._state.path if self._route is not None else None
        is_news = path is not self._state.path or self.is_flat is not self._was_flat
        self._was_flat = self.is_flat
        has_moved = math.dist(position, self._state.position) > MOVED_M
        if is_news or has_moved:
            self._settled = self._settled and not has_moved
            self._notify(position, path, now_s)
        elif not self._settled and now_s - self._state.now_s >= SETTLED_S:
            self._settled = True  # listeners that skip reports still get the last one
            self._notify(position, path, now_s)
        on_ground = position[2] - self._half_height_m <= ON_GROUND_M
        is_free = self._route is None and self._hover is None and self.pilot is None
        self._stands = self._settled and on_ground and is_free
        return True

    def _begin(self, goal: Location, position: Vector, now_s: float) -> None:
        here = Location.from_vector(position)
        if self.why_not_fly() or goal.distance_m(self._hover or here) <= ARRIVED_M:
            return
        path = self._plan(position, goal.to_vector(), now_s)
        if path is None:
            _log.warning("box %d stays: %s to %s", self._box, no_path(self.fence), goal.in_words())
            return
        self.pause_pilot(True)
        self._fly_anew(path, position, now_s)

    def _ahead(self, path: FlightPath, now_s: float) -> Sequence[Vector]:
        return super()._ahead(path, now_s) if self._route is None else self._route.ahead

    def _fly_anew(self, path: FlightPath | None, position: Vector, now_s: float) -> None:
        here = Location.from_vector(position)
        if path is None and self.why_not_fly():
            ground: Vector = (position[0], position[1], self._half_height_m)
            path = FlightPath(position, ground, now_s, ceiling_m=position[2])
        self._hover = here if path is None else None
        self._route = None
        if path is not None:
            self._route = self._route_of(path, here, Location.from_vector(path.goal))
        super()._fly_anew(path, position, now_s)

    def _route_of(self, path: FlightPath, here: Location, goal: Location) -> Route:
        """As high as a kinematic drone would fly."""
        high_m = max(path.above_start[2], path.above_goal[2])
        return Route(here, goal, high_m, lands=False, speed_m_s=SPEED_M_S, around=path.around)

    def _follow_pilot(self, now_s: float) -> bool:
        """Move the place that the drone holds as its pilot says; it waits for a slow drone."""
        pilot = self._pilot
        if pilot is None or pilot.paused or self._route is not None or self.why_not_fly():
            return False
        here = Location.from_vector(self._state.position)
        held = self._hover or here
        if here.distance_m(held) > PILOT_LEAD_M:
            pilot.wait(now_s)
        else:
            lift_m = self._half_height_m
            below = held._replace(height=held.height - lift_m).to_vector()
            x, y, z = self._piloted(pilot, below, now_s)
            self._hover = Location.from_vector((x, y, z + lift_m))
        return True

    def _fly(self, position: Vector, passed_s: float) -> None:
        self._use_battery(position, passed_s)
        here, target = Location.from_vector(position), self._hover
        route = self._route
        if route is not None:
            route.advance(here, passed_s)
            target = route.target
            slow = math.dist(self._velocity, (0.0, 0.0, 0.0)) < STANDS_M_S
            if target == route.end and here.distance_m(route.end) <= ARRIVED_M and slow:
                self._arrive(route.end)
        if target is None or (self._route is None and self._hover is None):
            self._pushed = None
            return
        goal = target.to_vector()
        self._trim = learnt_trim(self._trim, position, goal, passed_s)
        motors = controller_force(self._limits, position, self._velocity, goal, self._trim)
        air = drag(self._limits, self._velocity, self._wind)
        force = (motors[0] + air[0], motors[1] + air[1], motors[2] + air[2])
        self._physics.push(self._box, force, position)
        mass_kg, tick_s = self._limits.mass_kg, self._world.tick_s
        weight = (0.0, 0.0, -mass_kg * GRAVITY_M_S2)
        x, y, z = (
            speed + tick_s * (push + pull) / mass_kg
            for speed, push, pull in zip(self._velocity, force, weight)
        )
        self._pushed = (x, y, z)

    def _arrive(self, end: Location) -> None:
        self._route = None
        stands = end.height - self._half_height_m <= ON_GROUND_M
        self._hover = None if stands else end

    def _use_battery(self, position: Vector, passed_s: float) -> None:
        before = self.battery_percent()
        self._drain(passed_s, math.dist(self._velocity, (0.0, 0.0, 0.0)))
        if before > LAND_AT_PERCENT >= self.battery_percent():
            self._come_down(position)
        elif self.is_flat:
            self._route = self._hover = None  # the motors stop

    def _come_down(self, position: Vector) -> None:
        """With its last fifth: to its pad if there are crews, else to the ground below."""
        now_s, path = self._world.now_s, self._state.path
        if self._crews is None:
            path = None
        elif self._route is None or self._route.end.distance_m(self._home) > AT_HOME_M:
            path = self._plan(position, self._home.to_vector(), now_s)
        self._note(MeshEventKind.BATTERY_LOW, "it lands" if path is None else "it goes home")
        if path is None or path is not self._state.path:
            self._fly_anew(path, position, now_s)

    def _ask_for_battery(self, position: Vector, now_s: float) -> None:
        if self._crews is None:
            return
        stands = self._route is None and self._hover is None and not self.crashed
        wants_one = stands and self._battery.percent < READY_PERCENT
        if not wants_one or self._home.distance_m(Location.from_vector(position)) > AT_HOME_M:
            self._crews.leave(self._box, ONE_PAD)
        elif self._crews.serve(self._box, ONE_PAD, now_s):
            self._battery.swap()

    def _drain(self, passed_s: float, speed_m_s: float | None) -> None:
        was_flat = self.is_flat
        self._battery.use(passed_s, speed_m_s)
        if self.is_flat and not was_flat:
            self._note(MeshEventKind.BATTERY_EMPTY)

    def _check_hits(self, velocity: Vector, passed_s: float) -> None:
        assert self._pushed is not None
        hit_m_s = math.dist(velocity, self._pushed)
        in_air = self._state.position[2] - self._half_height_m > ON_GROUND_M
        is_held = in_air and hit_m_s > self._limits.held_m_s
        self._held_s = self._held_s + passed_s if is_held else 0.0
        if hit_m_s > self._limits.crash_m_s:
            self._crash(f"a hit of {hit_m_s:.1f} m/s")
        elif self._held_s > self._limits.held_s:
            self._crash("caught in something")

    def _crash(self, how: str) -> None:
        self.crashed = True
        self._route = self._hover = None
        self._note(MeshEventKind.CRASHED, how)
