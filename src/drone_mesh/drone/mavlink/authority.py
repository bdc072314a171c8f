"""Authority: who may fly the drone, this program or the human pilot, and why.

The human pilot always has priority. This program flies only while the autopilot is in the mode
meant for it. It leaves a mode that somebody else chose only for an order, and only if the operator
permits that; a repair never does. A drone that somebody else disarmed stays down until its pilot
gives it back.
"""

from __future__ import annotations

from drone_mesh.drone.mavlink.autopilots import Autopilot
from drone_mesh.drone.mavlink.disarming import Disarming
from drone_mesh.drone.mavlink.flight_area import FlightArea
from drone_mesh.drone.mavlink.limits import FlightLimits, Permissions
from drone_mesh.drone.mavlink.mode_choice import Chooser, ModeChoice
from drone_mesh.drone.mavlink.pilot_status import Phase
from drone_mesh.drone.mavlink.telemetry import Telemetry


class Authority:
    """Decides from the telemetry; sends nothing."""

    def __init__(
        self,
        telemetry: Telemetry,
        area: FlightArea,
        limits: FlightLimits,
        permissions: Permissions,
    ) -> None:
        self.choice = ModeChoice(telemetry)
        self.disarming = Disarming(telemetry)
        self._telemetry = telemetry
        self._area = area
        self._limits = limits
        self._permissions = permissions

    def on_heartbeat(self, now_s: float, phase: Phase) -> None:
        """The telemetry has a new heartbeat."""
        self.choice.on_heartbeat(now_s)
        autopilot = self._telemetry.autopilot
        assert autopilot is not None  # otherwise the heartbeat is not the drone's
        lands = phase is Phase.LANDING or self._was_ordered_to_land(autopilot)
        self.disarming.on_heartbeat(now_s, lands)

    def trouble(self, now_s: float) -> str:
        """Why no flight is possible now, under any control; empty if one is."""
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
        if not self._area.is_in_frame(telemetry.home):
            return "its home is more than 5 km from --origin"
        if telemetry.is_outside_fence:
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

    def why_not(self, now_s: float, phase: Phase, for_repair: bool = False) -> str:
        """Why a goal would be refused now; empty if it would be accepted.

        `for_repair`: the goal of a repair, not of an order.
        """
        trouble = self.trouble(now_s)
        if trouble:
            return trouble
        telemetry, may = self._telemetry, self._permissions
        autopilot = telemetry.autopilot
        assert autopilot is not None  # otherwise `trouble` has a reason
        on_ground = telemetry.on_ground(now_s)
        if phase is Phase.LANDING:
            return "landing, as ordered"
        mode = self._why_not_leave(now_s, autopilot, bool(on_ground), for_repair)
        if mode:
            return mode
        if self.disarming.by_others:
            own = autopilot.mode_name(autopilot.own_mode)
            return f"disarmed: its pilot has to arm, or choose {own} again"
        if not telemetry.armed and not may.may_arm:
            return "not armed: the pilot has to arm, or --may-arm"
        if on_ground and not may.may_take_off:
            return "on the ground: the pilot has to take off, or --may-take-off"
        return ""

    def _why_not_leave(
        self, now_s: float, autopilot: Autopilot, on_ground: bool, for_repair: bool
    ) -> str:
        """What forbids a change of the mode for a flight; empty if nothing does."""
        mode, choice, may = self._telemetry.mode, self.choice, self._permissions
        if mode == autopilot.own_mode:
            return ""
        name, own = autopilot.mode_name(mode), autopilot.mode_name(autopilot.own_mode)
        if not (on_ground and self._was_ordered_to_land(autopilot)):
            pause_s = None if for_repair else may.orders_may_take_back_s
            is_taken = choice.by is Chooser.OTHERS and pause_s is None
            if mode != autopilot.hold_mode or is_taken:
                return f"in {name}, flown by its pilot: this needs {own}"
            if choice.by is Chooser.OTHERS and pause_s is not None:
                rest_s = choice.since_s + pause_s - now_s
                if rest_s > 0.0:
                    return f"in {name}, flown by its pilot: not yet, for {rest_s:.0f} s"
        if not may.may_change_mode:
            return f"in {name}: the pilot has to choose {own}, or --may-change-mode"
        return ""

    def why_let_go(self, now_s: float, phase: Phase, since_s: float, for_repair: bool) -> str:
        """Why the current flight must end, in this phase since `since_s`; empty: it continues."""
        telemetry = self._telemetry
        trouble = self.trouble(now_s)
        autopilot = telemetry.autopilot
        if trouble or autopilot is None:
            return trouble
        if self.disarming.by_others and phase is not Phase.LANDING:
            return "disarmed"
        mode = telemetry.mode
        if mode == autopilot.own_mode:
            if phase in (Phase.TAKING_OFF, Phase.FLYING) and not telemetry.armed:
                return "disarmed"
            return ""
        if phase is Phase.CHANGING_MODE and not self.choice.was_made_after(since_s):
            on_ground = bool(telemetry.on_ground(now_s))
            if not self._why_not_leave(now_s, autopilot, on_ground, for_repair):
                return ""
        if phase is Phase.LANDING and mode == autopilot.land_mode:
            return ""
        return f"{autopilot.mode_name(mode)} was chosen: the pilot flies"

    def _was_ordered_to_land(self, autopilot: Autopilot) -> bool:
        return self._telemetry.mode == autopilot.land_mode and self.choice.by is Chooser.ENGINE
