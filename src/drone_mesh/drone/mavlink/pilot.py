"""MavlinkPilot: flies one drone by talking to its autopilot, as far as the human pilot allows.

The human pilot is the master. This program follows only while the autopilot is in the mode that is
meant for it, and lets go as soon as that mode ends for any reason. It never resumes a flight
that it let go of.
"""

from __future__ import annotations

import enum
import logging
import math
from dataclasses import dataclass
from typing import Callable

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from drone_mesh.drone.geodesy import EarthPlace, Origin
from drone_mesh.drone.goal import MAX_COORDINATE_M, MAX_HEIGHT_M
from drone_mesh.drone.interfaces import Location
from drone_mesh.drone.mavlink.autopilots import Autopilot
from drone_mesh.drone.mavlink.commander import Commander, ParameterCheck
from drone_mesh.drone.mavlink.limits import FlightLimits, Permissions
from drone_mesh.drone.mavlink.telemetry import Message, Telemetry
from drone_mesh.drone.route import Route
from drone_mesh.errors import GoalRefused

TARGET_PERIOD_S = 0.2  # 5 Hz: PX4 wants 2 Hz at least
TARGETS_BEFORE_MODE_S = 1.0  # PX4 wants targets for a second before it enters OFFBOARD
TAKE_OFF_M = 3.0  # our choice: above home, before the route begins
TAKEN_OFF_WITHIN_M = 1.0  # our choice
TAKE_OFF_WITHIN_S = 20.0  # our choice; armed and not risen by then, it gives up

_log = logging.getLogger(__name__)


class Phase(enum.Enum):
    """What the drone is doing for this program."""

    IDLE = "idle"
    CHANGING_MODE = "changing mode"
    ARMING = "arming"
    TAKING_OFF = "taking off"
    FLYING = "flying"
    HOLDING = "holding"
    LANDING = "landing"


UNDER_WAY = frozenset(Phase) - {Phase.IDLE, Phase.HOLDING}


@dataclass(frozen=True)
class PilotStatus:
    """One look at the drone. Never changes, so any thread may keep it."""

    phase: Phase = Phase.IDLE
    location: Location | None = None
    location_trouble: str = "no heartbeat from an ArduPilot or PX4 autopilot yet"
    home: Location | None = None
    why_not_fly: str = "no heartbeat from an ArduPilot or PX4 autopilot yet"
    autopilot: str = ""
    mode: str = ""
    armed: bool = False
    on_ground: bool | None = None
    battery_percent: float | None = None
    complaints: tuple[str, ...] = ()  # parameters that are not safe
    goal: Location | None = None

    @property
    def is_flying(self) -> bool:
        """Whether a flight to a goal is under way."""
        return self.phase in UNDER_WAY


class MavlinkPilot:
    """Driven from outside: messages and ticks come in, messages go out through `send`."""

    def __init__(
        self,
        node_id: int,
        origin: Origin,
        limits: FlightLimits,
        permissions: Permissions,
        send: Callable[[Message], None],
    ) -> None:
        self._origin = origin
        self._limits = limits
        self._permissions = permissions
        self._cruise_m = limits.layer_height_m(node_id)
        self._node_id = node_id
        self._telemetry = Telemetry()
        self._commander = Commander(self._telemetry, send)
        self._parameters = ParameterCheck(self._commander, self._telemetry)
        self._phase = Phase.IDLE
        self._phase_since_s = -math.inf
        self._goal: Location | None = None
        self._lands = False
        self._route: Route | None = None
        self._hold: Location | None = None
        self._we_landed = False  # the autopilot is in its landing mode because we said so
        self._target_due_s = -math.inf
        self._last_tick_s = -math.inf

    def on_message(self, message: Message, now_s: float) -> None:
        """Take a message from the link."""
        if not self._telemetry.on_message(message, now_s):
            return
        if message.get_type() == "COMMAND_ACK":
            self._commander.on_ack(message)
        elif message.get_type() == "PARAM_VALUE":
            self._parameters.on_value(message)

    def set_goal(self, goal: Location, lands: bool, now_s: float) -> None:
        """Fly there. Raises GoalRefused for a place outside the limits, or if it cannot fly."""
        if (goal, lands) == (self._goal, self._lands):
            return
        reason = self._why_not(now_s)
        if reason:
            raise GoalRefused(f"the drone cannot fly: {reason}")
        home = self._home()
        assert home is not None  # else there was a reason
        self._limits.check(goal, home)
        self._goal, self._lands = goal, lands
        _log.info(
            "node %d: the drone flies to latitude %g m, longitude %g m, height %g m%s",
            self._node_id,
            *goal,
            " and lands" if lands else "",
        )
        holds_in_air = self._phase is Phase.HOLDING and not self._telemetry.on_ground(now_s)
        if self._phase is Phase.FLYING or holds_in_air:
            self._fly(now_s)
        elif self._phase in (Phase.IDLE, Phase.HOLDING):
            self._enter(Phase.CHANGING_MODE, now_s)

    def tick(self, now_s: float) -> None:
        """Do what is due; to be called ten times a second or so."""
        passed_s = min(1.0, now_s - self._last_tick_s)
        self._last_tick_s = now_s
        self._commander.tick(now_s)
        self._parameters.tick(now_s)
        if self._phase is not Phase.IDLE:
            reason = self._why_let_go(now_s)
            if reason:
                self._let_go(reason, now_s)
        self._act(passed_s, now_s)

    def status(self, now_s: float) -> PilotStatus:
        """What there is to see."""
        telemetry = self._telemetry
        trouble = telemetry.link_trouble(now_s) or telemetry.position_trouble(now_s)
        autopilot = telemetry.autopilot
        return PilotStatus(
            phase=self._phase,
            location=None if trouble else self._here(now_s),
            location_trouble=trouble,
            home=self._home(),
            why_not_fly=self._why_not(now_s),
            autopilot=autopilot.name if autopilot else "",
            mode=autopilot.mode_name(telemetry.mode) if autopilot else "",
            armed=telemetry.armed,
            on_ground=telemetry.on_ground(now_s),
            battery_percent=telemetry.battery_percent(now_s),
            complaints=self._parameters.complaints,
            goal=self._goal,
        )

    # The pilot has priority ------------------------------------------------------------------

    def _trouble(self, now_s: float) -> str:
        """Why no flight is possible now, under any control; empty: it is possible."""
        telemetry, limits = self._telemetry, self._limits
        link = telemetry.link_trouble(now_s)
        if link:
            return link
        if telemetry.failsafe:
            return "the autopilot reports a failsafe"
        position = telemetry.position_trouble(now_s)
        if position:
            return position
        if telemetry.home is None:
            return "the autopilot has not reported its home yet"
        if not self._is_in_frame(telemetry.home):
            return "its home is more than 5 km from --origin"
        if telemetry.is_outside_fence():
            return "outside the autopilot's fence"
        battery = telemetry.battery_percent(now_s)
        if battery is None and limits.min_battery_percent > 0.0:
            return "the battery's charge is not reported"
        if battery is not None and battery < limits.min_battery_percent:
            return f"battery at {battery:.0f} %, below --min-battery {limits.min_battery_percent:g}"
        if telemetry.on_ground(now_s) is None:
            return "the autopilot does not report whether it has landed"
        if telemetry.sticks_moved(now_s):
            return "the pilot moved the sticks"
        return ""

    def _why_not(self, now_s: float) -> str:
        """Why a goal would not be flown to now; empty: it would."""
        trouble = self._trouble(now_s)
        if trouble:
            return trouble
        telemetry, may = self._telemetry, self._permissions
        autopilot = telemetry.autopilot
        assert autopilot is not None  # else there was trouble
        on_ground = telemetry.on_ground(now_s)
        if self._phase is Phase.LANDING:
            return "landing, as ordered"
        if telemetry.mode != autopilot.own_mode:
            name = autopilot.mode_name(telemetry.mode)
            own = autopilot.mode_name(autopilot.own_mode)
            if not self._may_leave(telemetry.mode, autopilot, bool(on_ground)):
                hold = autopilot.mode_name(autopilot.hold_mode)
                return f"in {name}, under its pilot's hand: only {own} (or {hold}) is ours"
            if not may.may_change_mode:
                return f"in {name}: the pilot has to choose {own}, or --may-change-mode"
        if not telemetry.armed and not may.may_arm:
            return "not armed: the pilot has to arm, or --may-arm"
        if on_ground and not may.may_take_off:
            return "on the ground: the pilot has to take off, or --may-take-off"
        return ""

    def _may_leave(self, mode: int, autopilot: Autopilot, on_ground: bool) -> bool:
        if mode == autopilot.hold_mode:
            return True
        return self._we_landed and mode == autopilot.land_mode and on_ground

    def _why_let_go(self, now_s: float) -> str:
        """Why what is under way has to end; empty: it goes on."""
        telemetry = self._telemetry
        trouble = self._trouble(now_s)
        autopilot = telemetry.autopilot
        if trouble or autopilot is None:
            return trouble
        mode = telemetry.mode
        if mode == autopilot.own_mode:
            if self._phase in (Phase.TAKING_OFF, Phase.FLYING) and not telemetry.armed:
                return "disarmed"
            return ""
        if self._phase is Phase.CHANGING_MODE and self._may_leave(
            mode, autopilot, bool(telemetry.on_ground(now_s))
        ):
            return ""
        if self._phase is Phase.LANDING and mode == autopilot.land_mode:
            return ""
        return f"{autopilot.mode_name(mode)} was chosen: the pilot flies"

    def _let_go(self, reason: str, now_s: float) -> None:
        """End what is under way. The drone holds where it is, or does what its autopilot chose."""
        telemetry = self._telemetry
        was, self._goal, self._route = self._phase, None, None
        self._commander.no_command()
        here = self._here(now_s)
        autopilot = telemetry.autopilot
        ours = autopilot is not None and telemetry.mode == autopilot.own_mode
        in_air = telemetry.armed and telemetry.on_ground(now_s) is False
        if ours and in_air and here is not None and not telemetry.link_trouble(now_s):
            self._hold = self._hold if was is Phase.HOLDING else self._within(here)
            self._enter(Phase.HOLDING, now_s)
        else:
            self._hold = None
            self._enter(Phase.IDLE, now_s)
        if was in UNDER_WAY:
            _log.warning("node %d: the flight ends: %s", self._node_id, reason)

    # The flight ------------------------------------------------------------------------------

    def _act(self, passed_s: float, now_s: float) -> None:
        if self._phase is Phase.IDLE:
            self._offer_targets(now_s)
        elif self._phase is Phase.CHANGING_MODE:
            self._change_mode(now_s)
        elif self._phase is Phase.ARMING:
            self._arm(now_s)
        elif self._phase is Phase.TAKING_OFF:
            self._take_off(now_s)
        elif self._phase is Phase.FLYING:
            self._fly_on(passed_s, now_s)
        elif self._phase is Phase.HOLDING:
            self._send_target(self._hold, now_s)
        elif self._phase is Phase.LANDING:
            self._land(now_s)

    def _offer_targets(self, now_s: float) -> None:
        """PX4 lets its pilot choose OFFBOARD only while targets arrive: stay where you are."""
        telemetry = self._telemetry
        autopilot = telemetry.autopilot
        if autopilot is None or not autopilot.wants_targets_beforehand:
            return
        if telemetry.armed and telemetry.on_ground(now_s) is False and not self._trouble(now_s):
            here = self._here(now_s)
            if telemetry.mode == autopilot.own_mode and here is not None:
                self._hold = self._within(here)
                self._enter(Phase.HOLDING, now_s)
            else:
                self._send_target(here, now_s)

    def _change_mode(self, now_s: float) -> None:
        telemetry = self._telemetry
        autopilot = telemetry.autopilot
        assert autopilot is not None  # else it had let go
        if telemetry.mode == autopilot.own_mode:
            self._we_landed = False
            self._enter(Phase.ARMING, now_s)
            return
        if autopilot.wants_targets_beforehand:
            self._send_target(self._here(now_s), now_s)
            if now_s - self._phase_since_s < TARGETS_BEFORE_MODE_S:
                return
        self._command(
            mavlink.MAV_CMD_DO_SET_MODE,
            (
                float(mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED),
                *autopilot.mode_parameters(autopilot.own_mode),
            ),
            now_s,
        )

    def _arm(self, now_s: float) -> None:
        if not self._telemetry.armed:
            autopilot = self._telemetry.autopilot
            if autopilot is not None and autopilot.wants_targets_beforehand:
                self._send_target(self._here(now_s), now_s)
            self._command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, (1.0,), now_s)
        elif self._telemetry.on_ground(now_s):
            self._enter(Phase.TAKING_OFF, now_s)
        else:
            self._fly(now_s)

    def _take_off(self, now_s: float) -> None:
        telemetry = self._telemetry
        here, home = self._here(now_s), self._home()
        autopilot = telemetry.autopilot
        assert autopilot is not None  # else it had let go, as in all that follows
        assert here is not None
        assert home is not None
        height_m = home.height + min(TAKE_OFF_M, self._limits.max_height_m)
        if here.height >= height_m - TAKEN_OFF_WITHIN_M and not telemetry.on_ground(now_s):
            self._fly(now_s)
        elif now_s - self._phase_since_s > TAKE_OFF_WITHIN_S:
            self._let_go("the drone did not take off", now_s)
        elif not autopilot.takes_off_by_command:
            self._send_target(here._replace(height=height_m), now_s)
        elif telemetry.on_ground(now_s):
            take_off = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, height_m - home.height)
            self._command(mavlink.MAV_CMD_NAV_TAKEOFF, take_off, now_s)

    def _fly(self, now_s: float) -> None:
        here, home = self._here(now_s), self._home()
        assert here is not None
        assert home is not None
        assert self._goal is not None
        ceiling_m = self._limits.ceiling_m(home)
        start = self._within(here)
        self._route = Route(
            start,
            self._goal,
            min(self._cruise_m, ceiling_m),
            self._lands,
            self._limits.speed_m_s,
        )
        self._commander.no_command()
        self._enter(Phase.FLYING, now_s)

    def _fly_on(self, passed_s: float, now_s: float) -> None:
        here, route = self._here(now_s), self._route
        assert here is not None
        assert route is not None
        if not route.advance(here, passed_s):
            self._send_target(route.target, now_s)
        elif self._lands:
            self._enter(Phase.LANDING, now_s)
        else:
            self._hold = route.end
            self._enter(Phase.HOLDING, now_s)
            _log.info("node %d: the drone has arrived and hovers", self._node_id)

    def _land(self, now_s: float) -> None:
        telemetry = self._telemetry
        if telemetry.on_ground(now_s):
            if not telemetry.armed:
                self._goal = None
                self._enter(Phase.IDLE, now_s)
                _log.info("node %d: the drone has landed", self._node_id)
            return
        autopilot = telemetry.autopilot
        if autopilot is not None and telemetry.mode != autopilot.land_mode:
            self._we_landed = True
            self._command(mavlink.MAV_CMD_NAV_LAND, (), now_s)

    def _command(self, command: int, parameters: tuple[float, ...], now_s: float) -> None:
        refusal = self._commander.command(command, parameters, now_s)
        if refusal:
            self._let_go(f"{self._phase.value}: {refusal}", now_s)

    def _enter(self, phase: Phase, now_s: float) -> None:
        self._phase = phase
        self._phase_since_s = now_s
        if phase in (Phase.IDLE, Phase.HOLDING):
            self._commander.no_command()

    # Places ----------------------------------------------------------------------------------

    def _here(self, now_s: float) -> Location | None:
        place = self._telemetry.place(now_s)
        return None if place is None else self._origin.to_frame(place)

    def _home(self) -> Location | None:
        home = self._telemetry.home
        return None if home is None else self._origin.to_frame(home)

    def _is_in_frame(self, place: EarthPlace) -> bool:
        location = self._origin.to_frame(place)
        reach_m = max(abs(location.latitude), abs(location.longitude))
        return reach_m <= MAX_COORDINATE_M and abs(location.height) <= MAX_HEIGHT_M

    def _within(self, place: Location) -> Location:
        """The nearest place inside the limits: no target lies outside them, wherever it is now."""
        home = self._home()
        if home is None:
            return place
        east, north = place.longitude - home.longitude, place.latitude - home.latitude
        distance_m = math.hypot(east, north)
        share = min(1.0, self._limits.max_distance_m / distance_m) if distance_m else 1.0
        return Location(
            latitude=home.latitude + north * share,
            longitude=home.longitude + east * share,
            height=min(place.height, self._limits.ceiling_m(home)),
        )

    def _send_target(self, target: Location | None, now_s: float) -> None:
        if target is None or now_s < self._target_due_s:
            return
        self._target_due_s = now_s + TARGET_PERIOD_S
        self._commander.target(self._origin.to_earth(self._within(target)))
