"""Authority: who may fly the drone, this program or the human pilot, and why; FlightArea: where.

The human pilot always has priority. This program flies only while the autopilot is in the mode
meant for it. It leaves a mode that somebody else chose only for an order, and only if the operator
permits that; a repair never does. A drone that somebody else disarmed stays down until its pilot
gives it back: a pilot who disarms wants it to stay down, and an autopilot that does has a reason,
such as a crash.
"""

from __future__ import annotations

import enum
import functools
import math

from drone_mesh.drone.geodesy import EarthPlace, Origin
from drone_mesh.drone.goal import MAX_COORDINATE_M, MAX_HEIGHT_M
from drone_mesh.drone.location import Location
from drone_mesh.drone.mavlink.autopilots import Autopilot
from drone_mesh.drone.mavlink.limits import FlightLimits, Permissions
from drone_mesh.drone.mavlink.pilot_status import Phase
from drone_mesh.drone.mavlink.telemetry import Telemetry

HOME_OFF_M = 10.0  # more than a GPS is wrong by, on a field without hills


class FlightArea:
    """Reads the telemetry; changes nothing."""

    def __init__(self, telemetry: Telemetry, origin: Origin, limits: FlightLimits) -> None:
        self._telemetry = telemetry
        self._limits = limits
        # Each tick asks several times for the same places: the drone's, its home and its target.
        self._to_frame = functools.lru_cache(maxsize=4)(origin.to_frame)
        self._to_earth = functools.lru_cache(maxsize=1)(origin.to_earth)

    def here(self, now_s: float) -> Location | None:
        """The drone's position; None if the telemetry does not have it."""
        place = self._telemetry.place(now_s)
        return None if place is None else self._to_frame(place)

    def home(self) -> Location | None:
        """The autopilot's home; None: not reported yet."""
        home = self._telemetry.home
        return None if home is None else self._to_frame(home)

    def is_in_frame(self, place: EarthPlace) -> bool:
        """Whether a position is near enough to the origin for goals."""
        location = self._to_frame(place)
        reach_m = max(abs(location.latitude), abs(location.longitude))
        return reach_m <= MAX_COORDINATE_M and abs(location.height) <= MAX_HEIGHT_M

    def doubts(self) -> str:
        """Why --origin may have a wrong altitude; empty without a sign of that."""
        home = self.home()
        if home is None or abs(home.height) <= HOME_OFF_M:
            return ""
        where = "above" if home.height > 0.0 else "below"
        return (
            f"its home is {abs(home.height):.0f} m {where} --origin: unless the ground is, correct "
            "the altitude of --origin, in metres above sea level"
        )

    def within(self, place: Location) -> Location:
        """The nearest position within the limits; no target is outside, wherever the drone is."""
        home = self.home()
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

    def to_earth(self, place: Location) -> EarthPlace:
        """A position, moved into the limits, in degrees."""
        return self._to_earth(self.within(place))


FELL_M = 1.5  # above the noise of a height at rest
FELL_WITHIN_S = 5.0  # a fall from 50 m takes 3.2 s
ORDER_WITHIN_S = 5.0  # an order of this program has changed the mode by then
ARMED_WITHIN_S = 0.5  # a heartbeat just after the acknowledgement may be older


class Disarming:
    """Whether anything but an ordered landing has disarmed the drone.

    Follows the heartbeats, and what this program orders. While `by_others`, this program must not
    arm it until somebody else does, or chooses its mode anew.
    """

    def __init__(self, telemetry: Telemetry) -> None:
        self.by_others = False
        self.is_settling = False  # after a landing: it may have been disarmed in the air
        self._telemetry = telemetry
        self._was_armed = False
        self._armed_s = -math.inf  # when the autopilot accepted to arm
        self._mode: int | None = None  # at the last heartbeat
        self._ordered_s = -math.inf  # when this program last ordered its own mode
        self._height_m = math.nan  # above sea level, when last seen armed
        self._landed_s = -math.inf  # when a landing seemed to have ended

    def ordered_own_mode(self, now_s: float) -> None:
        """This program orders its own mode: that change is no choice of the pilot's."""
        self._ordered_s = now_s

    def accepted_to_arm(self, now_s: float) -> None:
        """The autopilot acknowledges that it armed by this program's order."""
        self._was_armed = True
        self._armed_s = now_s

    def on_heartbeat(self, now_s: float, lands: bool) -> None:
        """Compare with the heartbeat before.

        `lands`: this program is landing the drone, or has just landed it.
        """
        telemetry = self._telemetry
        assert telemetry.autopilot is not None  # otherwise the heartbeat is not the drone's
        place = telemetry.place(now_s)
        height_m = math.nan if place is None else place.altitude_m
        is_own = telemetry.mode == telemetry.autopilot.own_mode != self._mode
        self._mode = telemetry.mode
        if not telemetry.armed and self._was_armed and now_s - self._armed_s < ARMED_WITHIN_S:
            return
        if telemetry.armed:
            self.by_others = self.is_settling = False
            self._height_m = height_m
        elif self._was_armed:
            self.is_settling = lands and not math.isnan(self._height_m)
            self.by_others = not self.is_settling
            self._landed_s = now_s
        elif is_own and now_s - self._ordered_s >= ORDER_WITHIN_S:
            self.by_others = self.is_settling = False
        elif self.is_settling and not math.isnan(height_m):
            self.by_others = height_m < self._height_m - FELL_M
            self.is_settling = not self.by_others and now_s - self._landed_s < FELL_WITHIN_S
        self._was_armed = telemetry.armed


class Chooser(enum.Enum):
    """Whose choice the mode is."""

    ENGINE = "this program, or somebody who chose the mode in which it flies"
    OTHERS = "the pilot, a ground station or the autopilot"
    NOBODY = "found at the first contact on a disarmed drone, which nobody has armed since"


class ModeChoice:
    """Who chose the mode: what this program has not commanded, somebody else has chosen.

    A failsafe that acts in a mode of this program's makes that mode the autopilot's choice.
    """

    def __init__(self, telemetry: Telemetry) -> None:
        self._telemetry = telemetry
        self._mode: int | None = None  # at the last heartbeat
        self._armed = False
        self._commanded: int | None = None
        self.by = Chooser.NOBODY
        self.since_s = -math.inf  # when somebody else chose it

    def was_made_after(self, time_s: float) -> bool:
        """Whether somebody else chose the mode later than this."""
        return self.by is Chooser.OTHERS and self.since_s > time_s

    def command(self, mode: int) -> None:
        """This program is about to order this mode."""
        self._commanded = mode

    def withdraw(self) -> None:
        """Stop expecting the mode that this program ordered, unless it is reported already."""
        if self._commanded != self._mode:
            self._commanded = None

    def accepted(self, mode: int) -> None:
        """The autopilot acknowledges that it is in this mode, ordered by this program.

        A later heartbeat with another mode therefore tells of a choice, even of the mode before.
        """
        self._mode = mode
        self._commanded = None
        self.by = Chooser.ENGINE

    def on_heartbeat(self, now_s: float) -> None:
        telemetry = self._telemetry
        assert telemetry.autopilot is not None  # otherwise the heartbeat is not the drone's
        before, was_armed = self._mode, self._armed
        mode, armed = telemetry.mode, telemetry.armed
        self._mode, self._armed = mode, armed
        if mode == telemetry.autopilot.own_mode:
            self.by = Chooser.ENGINE
            if before != mode:
                self._commanded = None
        elif before is None:
            self._decide(Chooser.OTHERS if armed else Chooser.NOBODY, now_s)
        elif mode != before:
            self._decide(Chooser.ENGINE if mode == self._commanded else Chooser.OTHERS, now_s)
        elif self.by is not Chooser.OTHERS and (telemetry.failsafe or armed and not was_armed):
            self._decide(Chooser.OTHERS, now_s)

    def _decide(self, by: Chooser, now_s: float) -> None:
        self.by = by
        if by is Chooser.OTHERS:
            self.since_s = now_s
            self._commanded = None


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
        """The reason why the mode may not be changed for a flight; empty if it may."""
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
