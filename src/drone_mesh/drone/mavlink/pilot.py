"""MavlinkPilot: flies one drone through its autopilot, as far as the human pilot allows.

It releases control as soon as its authority ends for any reason (`authority.py`), and never resumes
a released flight.
"""

from __future__ import annotations

import logging
import math
from typing import Callable

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from drone_mesh.drone.fence import CLEAR_M, Fence, called
from drone_mesh.drone.flight_path import Point
from drone_mesh.drone.geodesy import Origin
from drone_mesh.drone.location import Location
from drone_mesh.drone.mavlink.authority import Authority, FlightArea
from drone_mesh.drone.mavlink.autopilots import US
from drone_mesh.drone.mavlink.commander import CARRIED_OUT_WITHIN_S, Commander
from drone_mesh.drone.mavlink.limits import FlightLimits, Permissions
from drone_mesh.drone.mavlink.own_fence import OwnFence
from drone_mesh.drone.mavlink.parameter_check import ParameterCheck
from drone_mesh.drone.mavlink.pilot_status import UNDER_WAY, Phase, PilotStatus
from drone_mesh.drone.mavlink.telemetry import Message, Telemetry
from drone_mesh.drone.route import Route
from drone_mesh.drone.way_round import way_across
from drone_mesh.errors import GoalRefused

TARGET_PERIOD_S = 0.2  # 5 Hz: PX4 needs at least 2 Hz
TARGETS_BEFORE_MODE_S = 1.0  # PX4 needs targets for a second before it enters OFFBOARD
HOLD_TARGETS_S = 3.0  # 15 targets at the end of a flight, of which a line may lose some
TAKE_OFF_M = 3.0  # above home, before the route begins
TAKEN_OFF_WITHIN_M = 1.0
TAKE_OFF_WITHIN_S = 40.0  # the motors spool up first, and a climb may be slow
NO_PROGRESS = "the last flight made no progress"
STALLED_S = 20.0  # a flight that moves less than STALLED_M in this time has ended
STALLED_M = 1.0  # more than the noise of a position
_MODE_CHANGED = (mavlink.MAV_CMD_DO_SET_MODE, mavlink.MAV_RESULT_ACCEPTED)
_ARMED = (mavlink.MAV_CMD_COMPONENT_ARM_DISARM, mavlink.MAV_RESULT_ACCEPTED)

_log = logging.getLogger(__name__)


class MavlinkPilot:
    """Driven from outside: receives messages and ticks, sends messages through `send`."""

    def __init__(
        self,
        node_id: int,
        origin: Origin,
        limits: FlightLimits,
        permissions: Permissions,
        send: Callable[[Message], None],
        fence: Fence = Fence(),  # noqa: B008 (frozen)
    ) -> None:
        self._given_fence = fence
        self._limits = limits
        self._cruise_m = limits.layer_height_m(node_id)
        self._node_id = node_id
        self._telemetry = Telemetry()
        self._area = FlightArea(self._telemetry, origin, limits)
        self._authority = Authority(self._telemetry, self._area, limits, permissions)
        self._commander = Commander(self._telemetry, send)
        self._parameters = ParameterCheck(self._commander, self._telemetry)
        self._own_fence = OwnFence(self._telemetry, origin, send)
        self._flown_in = fence  # what the route keeps
        self._phase = Phase.IDLE
        self._phase_since_s = -math.inf
        self._goal: Location | None = None
        self._lands = False
        self._for_repair = False
        self._ended = ""  # why the last flight ended before its goal
        self._route: Route | None = None
        self._hold: Location | None = None
        self._stalled = False  # the last flight made no progress
        self._moved: tuple[Location, float] | None = None  # where it last moved, and when
        self._target_due_s = -math.inf
        self._last_tick_s = -math.inf
        self._doubted = False  # a warning about --origin was logged
        self._slept_s = -math.inf  # no heartbeat was heard since the caller awoke then

    def on_message(self, message: Message, now_s: float) -> None:
        if not self._telemetry.on_message(message, now_s):
            return
        if message.get_type() == "HEARTBEAT":
            self._authority.on_heartbeat(now_s, self._phase)
        elif message.get_type() == "COMMAND_ACK":
            if _is_for_us(message):
                self._commander.on_ack(message, now_s)
                self._on_ack(message, now_s)
        elif message.get_type() == "STATUSTEXT":
            self._commander.on_text(message)
        elif message.get_type() == "PARAM_VALUE":
            self._parameters.on_value(message)
            self._own_fence.on_value(message, now_s)
        elif message.get_type() in ("MISSION_COUNT", "MISSION_ITEM_INT", "MISSION_ACK"):
            self._own_fence.on_mission(message, now_s)
        elif message.get_type() == "HOME_POSITION":
            self._doubt_origin()

    def set_goal(self, goal: Location, lands: bool, now_s: float, for_repair: bool = False) -> None:
        """Fly there. Raises GoalRefused for a position outside the limits, or if it cannot fly.

        `for_repair`: to repair the mesh, not by an order.
        """
        if (goal, lands) == (self._goal, self._lands):
            return
        reason = self._why_not(now_s, for_repair)
        if reason:
            raise GoalRefused(f"the drone cannot fly: {reason}")
        if for_repair and self._stalled:
            raise GoalRefused(f"the drone cannot fly: {NO_PROGRESS}")
        home = self._area.home()
        assert home is not None  # otherwise there was a reason
        self._limits.check(goal, home)
        here = self._area.here(now_s)
        assert here is not None  # likewise
        self._way(here, goal, home)
        self._stalled = False
        self._goal, self._lands, self._for_repair = goal, lands, for_repair
        self._ended = ""
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

    def slept(self, now_s: float) -> None:
        """The caller read nothing for a while: what it read just now may be old.

        Until another heartbeat shows the mode, the pilot sends nothing that moves the drone.
        """
        self._slept_s = now_s

    def tick(self, now_s: float) -> None:
        """Do what is due; to be called about ten times a second."""
        passed_s = min(1.0, now_s - self._last_tick_s)
        self._last_tick_s = now_s
        self._commander.tick(now_s)
        self._parameters.tick(now_s)
        self._own_fence.tick(now_s)
        if self._telemetry.heartbeat_s <= self._slept_s and not self._telemetry.link_trouble(now_s):
            return
        if self._phase is not Phase.IDLE:
            reason = self._authority.why_let_go(
                now_s, self._phase, self._phase_since_s, self._for_repair
            )
            if reason:
                self._let_go(reason, now_s)
        self._act(passed_s, now_s)

    def status(self, now_s: float) -> PilotStatus:
        telemetry = self._telemetry
        trouble = telemetry.link_trouble(now_s) or telemetry.position_trouble(now_s)
        autopilot = telemetry.autopilot
        return PilotStatus(
            phase=self._phase,
            location=None if trouble else self._area.here(now_s),
            location_trouble=trouble,
            home=self._area.home(),
            why_not_fly=self._why_not(now_s),
            why_not_repair=self._why_not(now_s, for_repair=True)
            or (NO_PROGRESS if self._stalled else ""),
            ended=self._ended,
            autopilot=autopilot.name if autopilot else "",
            mode=autopilot.mode_name(telemetry.mode) if autopilot else "",
            armed=telemetry.armed,
            on_ground=telemetry.on_ground(now_s),
            battery_percent=telemetry.battery_percent(now_s),
            complaints=self._parameters.complaints,
            goal=self._goal,
        )

    def fences(self) -> Fence:
        """The given one and the autopilot's own. Any thread."""
        return Fence((*self._given_fence.rules, *self._own_fence.fence.rules))

    def _why_not(self, now_s: float, for_repair: bool = False) -> str:
        return self._authority.why_not(now_s, self._phase, for_repair) or self._own_fence.trouble

    def _doubt_origin(self) -> None:
        """Log once what the autopilot's home says about --origin."""
        doubts = self._area.doubts()
        if doubts and not self._doubted:
            self._doubted = True
            _log.warning("node %d: %s", self._node_id, doubts)

    def _let_go(self, reason: str, now_s: float) -> None:
        """End the flight. The drone holds its position, or does what its autopilot chose."""
        telemetry = self._telemetry
        was, self._goal, self._route = self._phase, None, None
        self._commander.no_command()
        self._authority.choice.withdraw()
        here = self._area.here(now_s)
        autopilot = telemetry.autopilot
        ours = autopilot is not None and telemetry.mode == autopilot.own_mode
        in_air = telemetry.armed and telemetry.on_ground(now_s) is False
        if ours and in_air and here is not None and not telemetry.link_trouble(now_s):
            if was is not Phase.HOLDING:
                self._hold = self._area.within(here)
                self._enter(Phase.HOLDING, now_s)
        else:
            self._hold = None
            self._enter(Phase.IDLE, now_s)
        if was in UNDER_WAY:
            self._ended = reason
            _log.warning("node %d: the flight ends: %s", self._node_id, reason)

    def _on_ack(self, message: Message, now_s: float) -> None:
        autopilot = self._telemetry.autopilot
        done = message.command, message.result
        if done == _MODE_CHANGED and self._phase is Phase.CHANGING_MODE and autopilot is not None:
            self._authority.choice.accepted(autopilot.own_mode)
        elif done == _ARMED and self._phase is Phase.ARMING:
            self._authority.disarming.accepted_to_arm(now_s)

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
            self._hold_on(now_s)
        elif self._phase is Phase.LANDING:
            self._land(now_s)

    def _offer_targets(self, now_s: float) -> None:
        """PX4's pilot can choose OFFBOARD only while targets arrive: send the current position."""
        telemetry = self._telemetry
        autopilot = telemetry.autopilot
        if autopilot is None or not autopilot.wants_targets_beforehand:
            return
        if (
            telemetry.armed
            and telemetry.on_ground(now_s) is False
            and not self._authority.trouble(now_s)
        ):
            here = self._area.here(now_s)
            if telemetry.mode == autopilot.own_mode and here is not None:
                self._hold = self._area.within(here)
                self._enter(Phase.HOLDING, now_s)
            else:
                self._send_target(here, now_s)

    def _change_mode(self, now_s: float) -> None:
        telemetry = self._telemetry
        autopilot = telemetry.autopilot
        assert autopilot is not None  # otherwise it has let go
        if telemetry.mode == autopilot.own_mode:
            self._enter(Phase.ARMING, now_s)
            return
        if autopilot.wants_targets_beforehand:
            self._send_target(self._area.here(now_s), now_s)
            if now_s - self._phase_since_s < TARGETS_BEFORE_MODE_S:
                return
        self._authority.disarming.ordered_own_mode(now_s)
        self._command(
            mavlink.MAV_CMD_DO_SET_MODE,
            (
                float(mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED),
                *autopilot.mode_parameters(autopilot.own_mode),
            ),
            now_s,
            # In the air a repetition could undo what the pilot has chosen since.
            once=not telemetry.on_ground(now_s),
        )

    def _arm(self, now_s: float) -> None:
        if not self._telemetry.armed:
            autopilot = self._telemetry.autopilot
            if autopilot is not None and autopilot.wants_targets_beforehand:
                self._send_target(self._area.here(now_s), now_s)
            if not self._authority.disarming.is_settling:
                self._command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, (1.0,), now_s)
        elif self._telemetry.on_ground(now_s):
            self._enter(Phase.TAKING_OFF, now_s)
        else:
            self._fly(now_s)

    def _take_off(self, now_s: float) -> None:
        telemetry = self._telemetry
        here, home = self._area.here(now_s), self._area.home()
        autopilot = telemetry.autopilot
        assert autopilot is not None  # otherwise it has let go; also below
        assert here is not None
        assert home is not None
        height_m = home.height + min(TAKE_OFF_M, self._limits.max_height_m)
        if here.height >= height_m - TAKEN_OFF_WITHIN_M and not telemetry.on_ground(now_s):
            self._fly(now_s)
        elif now_s - self._phase_since_s > TAKE_OFF_WITHIN_S:
            words = self._commander.words() or "it did not reach the height of a take-off"
            self._let_go(f"{self._phase.value}: {words}", now_s)
        elif not autopilot.takes_off_by_command:
            self._send_target(here._replace(height=height_m), now_s)
        elif telemetry.on_ground(now_s):
            take_off = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, height_m - home.height)
            self._command(mavlink.MAV_CMD_NAV_TAKEOFF, take_off, now_s, TAKE_OFF_WITHIN_S)

    def _fly(self, now_s: float) -> None:
        here, home = self._area.here(now_s), self._area.home()
        assert here is not None
        assert home is not None
        assert self._goal is not None
        start = self._area.within(here)
        try:
            cross_at_m, around = self._way(start, self._goal, home)
        except GoalRefused as error:  # the wind has moved it meanwhile
            self._let_go(str(error), now_s)
            return
        self._route = Route(
            start, self._goal, cross_at_m, self._lands, self._limits.speed_m_s, around
        )
        self._flown_in = self.fences()
        self._commander.no_command()
        self._moved = None
        self._enter(Phase.FLYING, now_s)

    def _way(
        self, start: Location, goal: Location, home: Location
    ) -> tuple[float, tuple[Point, ...]]:
        """Height and corners of a way that keeps the fences. Raises GoalRefused.

        Straight in its layer, else the shortest; it never goes down first, unless it is outside and
        there is no other way: what is below it there is not known.
        """
        fence, ceiling_m = self.fences(), self._limits.ceiling_m(home)
        one, other = start.to_vector(), goal.to_vector()
        usual_m = max(min(self._cruise_m, ceiling_m), goal.height)
        level_m = max(usual_m, start.height)
        below = (height_m - CLEAR_M for height_m in fence.ceilings)
        above = (rule.top_m + CLEAR_M for rule in fence.rules)
        lowest_m = max(goal.height, home.height + TAKE_OFF_M)
        heights = {h for h in below if lowest_m <= h < usual_m}
        heights |= {usual_m, *(h for h in above if usual_m < h <= ceiling_m)}
        if not fence.why_not(one):
            heights = {h for h in heights if h >= start.height}
        ways: list[tuple[bool, float, float, tuple[Point, ...]]] = []  # by their length
        for height_m in (level_m, *(heights - {level_m})):
            around = way_across(fence, (), one, other, height_m)
            if around == () and height_m == level_m:
                return height_m, around
            if around is not None:
                level = [one[:2], *around, other[:2]]
                length_m = 2.0 * height_m + sum(map(math.dist, level, level[1:]))
                ways.append((height_m < start.height, length_m, height_m, around))
        if ways:
            return min(ways)[2:]
        raise GoalRefused(
            fence.why_not(goal.to_vector()) or f"no path that keeps {called(fence.names)}"
        )

    def _fly_on(self, passed_s: float, now_s: float) -> None:
        here, route = self._area.here(now_s), self._route
        assert here is not None
        assert route is not None
        if self.fences() != self._flown_in:
            self._fly(now_s)
        elif not route.advance(here, passed_s):
            self._send_target(route.target, now_s)
            self._watch_progress(here, now_s)
        elif self._lands:
            self._enter(Phase.LANDING, now_s)
        else:
            self._hold = route.end
            self._enter(Phase.HOLDING, now_s)
            _log.info("node %d: the drone has arrived and hovers", self._node_id)

    def _hold_on(self, now_s: float) -> None:
        """Keep sending targets after a flight: PX4 leaves OFFBOARD without them."""
        autopilot = self._telemetry.autopilot
        assert autopilot is not None  # otherwise it has let go
        is_new = now_s - self._phase_since_s < HOLD_TARGETS_S
        if is_new or autopilot.wants_targets_beforehand:
            self._send_target(self._hold, now_s)
        else:
            self._hold = self._goal = None  # it may be flown elsewhere, and be ordered back

    def _watch_progress(self, here: Location, now_s: float) -> None:
        """End a flight without progress: its targets are beyond the fence, or the drone crashed."""
        if self._moved is None or here.distance_m(self._moved[0]) > STALLED_M:
            self._moved = (here, now_s)
        elif now_s - self._moved[1] > STALLED_S:
            self._stalled = True
            self._let_go(f"the drone has not moved for {STALLED_S:g} s", now_s)

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
            if autopilot.wants_targets_beforehand and self._route is not None:
                self._send_target(self._route.end, now_s)  # the order to land may get lost
            self._authority.choice.command(autopilot.land_mode)
            self._command(mavlink.MAV_CMD_NAV_LAND, (), now_s)

    def _command(
        self,
        command: int,
        parameters: tuple[float, ...],
        now_s: float,
        within_s: float = CARRIED_OUT_WITHIN_S,
        once: bool = False,
    ) -> None:
        refusal = self._commander.command(command, parameters, now_s, within_s, once)
        if refusal:
            self._let_go(f"{self._phase.value}: {refusal}", now_s)

    def _enter(self, phase: Phase, now_s: float) -> None:
        self._phase = phase
        self._phase_since_s = now_s
        if phase in (Phase.IDLE, Phase.HOLDING):
            self._commander.no_command()

    def _send_target(self, target: Location | None, now_s: float) -> None:
        if target is None or now_s < self._target_due_s:
            return
        self._target_due_s = now_s + TARGET_PERIOD_S
        self._commander.target(self._area.to_earth(target))


def _is_for_us(acknowledgement: Message) -> bool:
    """A router or an autopilot also passes on what answers a ground station; 0: not told."""
    target = acknowledgement.target_system, acknowledgement.target_component
    return all(told in (0, own) for told, own in zip(target, US))
