"""MavlinkVehicle: a drone with an autopilot, as seen through its MAVLink port."""

from __future__ import annotations

import math
from typing import Callable

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from drone_mesh.drone.geodesy import EarthPlace, Origin
from drone_mesh.drone.location import Location
from drone_mesh.drone.mavlink.autopilots import OUR_SYSTEM_ID, PX4, Autopilot
from drone_mesh.drone.mavlink.telemetry import Message
from mavlink_vehicle.body import LANDING_SPEED_M_S, Body, VehicleFaults
from mavlink_vehicle.fence import FENCE_MESSAGES, FenceStore
from mavlink_vehicle.modes import Mode, mode_of
from mavlink_vehicle.parameters import Parameters
from mavlink_vehicle.reports import Reports

RETURN_HEIGHT_M = 15.0  # ArduPilot's RTL_ALT
GROUND_STATION_LOST_S = 5.0  # ArduPilot's FS_GCS_TIMEOUT
LOW_BATTERY_PERCENT = 15.0  # PX4's BAT_LOW_THR
MOST_DISTANCE_M = 100_000.0  # a target farther away is invalid
DISARMS_AFTER_S = 10.0  # on the ground, armed, nothing to do: both autopilots disarm

ACCEPTED = mavlink.MAV_RESULT_ACCEPTED
DENIED = mavlink.MAV_RESULT_DENIED
UNSUPPORTED = mavlink.MAV_RESULT_UNSUPPORTED
REJECTED = mavlink.MAV_RESULT_TEMPORARILY_REJECTED


class MavlinkVehicle:
    """Driven from outside: receives messages and ticks, sends messages through `send`.

    The ground is level, at the height of home. Nothing here reads a clock.
    """

    def __init__(
        self,
        autopilot: Autopilot,
        home: Origin,
        send: Callable[[Message], None],
        system_id: int = 1,
    ) -> None:
        """At home, disarmed, in its holding mode."""
        self.autopilot = autopilot
        self.system_id = system_id
        self.home = home
        self.faults = VehicleFaults()
        self.body = Body()
        self.parameters = parameters = Parameters(autopilot, self._send)
        self.fence = FenceStore(self._send)
        self.mode = Mode.HOLD
        self.in_failsafe = False
        self._failed: set[str] = set()  # the causes of failsafes that have acted
        self.now_s = 0.0
        self._transmit = send
        self._target: Location | None = None
        self._target_s = -math.inf
        self._stands_since_s = math.inf
        self._lifts_s = -math.inf  # when the motors have spooled up
        self._ground_station_s = math.nan  # when its heartbeat was heard; NaN: never
        self._reports = Reports(self)
        self._takes: dict[str, Callable[[Message], None]] = {
            "HEARTBEAT": self._take_heartbeat,
            "COMMAND_LONG": self._take_command,
            "SET_POSITION_TARGET_GLOBAL_INT": self._take_target,
            "PARAM_REQUEST_READ": parameters.take_read_request,
            **dict.fromkeys(FENCE_MESSAGES, self.fence.take),
        }

    # Actions of the human pilot --------------------------------------------------------------

    def choose_mode(self, mode: Mode) -> None:
        """The pilot selects a mode."""
        self._enter(mode)

    def arm(self) -> None:
        """The pilot arms it."""
        self.body.armed = True
        self._stands_since_s = self.now_s

    # From outside ----------------------------------------------------------------------------

    def on_message(self, message: Message, now_s: float) -> None:
        """Process a message from the link."""
        self.now_s = now_s
        addressee = getattr(message, "target_system", 0)
        if self.faults.silent or addressee not in (0, self.system_id):
            return
        take = self._takes.get(message.get_type())
        if take is not None:
            take(message)

    def tick(self, now_s: float) -> None:
        """Fly on to this time and send what is due."""
        passed_s = min(1.0, max(0.0, now_s - self.now_s))
        self.now_s = now_s
        self._watch_for_failsafes()
        self._fly(passed_s)
        for message in self._reports.due(now_s):
            self._send(message)

    def _send(self, message: Message) -> None:
        if not self.faults.silent:
            self._transmit(message)

    # Flight ----------------------------------------------------------------------------------

    def _fly(self, passed_s: float) -> None:
        body = self.body
        here = body.place
        target, speed_m_s = self._target, body.speed_m_s
        if self.mode is Mode.LAND:
            target, speed_m_s = here._replace(height=0.0), LANDING_SPEED_M_S
        elif self.mode is Mode.RETURN:
            target, speed_m_s = self._way_home(here)
        elif self.mode in (Mode.PILOT, Mode.HOLD) and self._target is None:
            target = here
        if self.now_s < self._lifts_s:
            target = here
        body.move(target, passed_s, speed_m_s)
        self._disarm_on_ground()

    def _way_home(self, here: Location) -> tuple[Location, float]:
        above_home = Location(0.0, 0.0, max(RETURN_HEIGHT_M, here.height))
        if math.hypot(here.latitude, here.longitude) < 0.1:
            return Location(0.0, 0.0, 0.0), LANDING_SPEED_M_S
        if here.height < RETURN_HEIGHT_M - 0.1:
            return here._replace(height=RETURN_HEIGHT_M), self.body.speed_m_s
        return above_home, self.body.speed_m_s

    def _disarm_on_ground(self) -> None:
        body = self.body
        if not body.armed or not body.on_ground:
            self._stands_since_s = self.now_s
        elif (
            self.mode in (Mode.LAND, Mode.RETURN)
            or self.now_s - self._stands_since_s > DISARMS_AFTER_S
        ):
            body.armed = False
            self._target = None

    def _enter(self, mode: Mode) -> None:
        if mode is not self.mode:
            self.mode = mode
            self._target = None

    # Failsafes -------------------------------------------------------------------------------

    def _watch_for_failsafes(self) -> None:
        """Each acts once, as its cause comes: whoever chooses another mode then, has it.

        A breached fence is no failsafe in ArduPilot's heartbeat, and a low battery stays one.
        """
        causes = self._causes()
        if self.body.armed and not self.body.on_ground:
            for cause, mode in causes.items():
                if cause not in self._failed:
                    self._failed.add(cause)
                    at_fence = cause == "fence" and self.autopilot is not PX4
                    if at_fence:  # before any heartbeat that shows the mode
                        self._send(mavlink.MAVLink_fence_status_message(1, 1, 3, 0))
                    self._fail_to(mode, is_shown=not at_fence)
        over = {cause for cause in self._failed - {"battery"} if cause not in causes}
        self._failed -= over
        if over and not self._failed - {"fence"}:
            self.in_failsafe = False

    def _causes(self) -> dict[str, Mode]:
        """And the mode that each leads to."""
        causes, parameters, faults = {}, self.parameters, self.faults
        if self.body.battery_percent < LOW_BATTERY_PERCENT:
            returns = parameters.get("BATT_FS_LOW_ACT") == 2.0
            causes["battery"] = Mode.RETURN if returns else Mode.LAND
        if not faults.estimate_good:
            causes["estimate"] = Mode.LAND
        if faults.fence_breached:
            causes["fence"] = Mode.RETURN
        if self.autopilot is PX4:
            silent_s = self.now_s - self._target_s
            if self.mode is Mode.FOLLOW and silent_s > parameters["COM_OF_LOSS_T"]:
                actions = {3: Mode.RETURN, 4: Mode.LAND, 5: Mode.HOLD}
                causes["targets"] = actions.get(int(parameters["COM_OBL_RC_ACT"]), Mode.PILOT)
        elif self.now_s - self._ground_station_s > GROUND_STATION_LOST_S:
            action = int(parameters["FS_GCS_ENABLE"])
            if action:
                causes["node"] = Mode.RETURN if action == 1 else Mode.LAND
            if action and self.mode in (Mode.PILOT, Mode.HOLD):
                causes["node"] = self.mode  # FS_OPTIONS 16, the default
        return causes

    def _fail_to(self, mode: Mode, is_shown: bool = True) -> None:
        lands_on = self.mode is Mode.LAND and int(self.parameters.get("FS_OPTIONS", 8.0)) & 8
        if not lands_on and mode is not self.mode:
            self._enter(mode)
        self.in_failsafe = self.in_failsafe or is_shown and mode is not Mode.HOLD
        self._say(mavlink.MAV_SEVERITY_CRITICAL, f"failsafe: {mode.value}")

    def _say(self, severity: int, text: str) -> None:
        self._send(mavlink.MAVLink_statustext_message(severity, text.encode()))

    # Messages --------------------------------------------------------------------------------

    def _take_heartbeat(self, message: Message) -> None:
        if message.get_srcSystem() == OUR_SYSTEM_ID:
            self._ground_station_s = self.now_s

    def _take_target(self, message: Message) -> None:
        ignored = mavlink.POSITION_TARGET_TYPEMASK_X_IGNORE
        if message.type_mask & ignored or not math.isfinite(message.alt):
            return
        target = self._place(message.lat_int, message.lon_int, message.alt)
        if target is None:
            return
        self._target_s = self.now_s
        if self.mode is not Mode.FOLLOW:
            return
        if self.autopilot is not PX4 and self.body.on_ground:
            return  # ArduPilot requires a take-off first
        self._target = target

    def _place(self, lat: int, lon: int, altitude_m: float) -> Location | None:
        """Relative to home; None: not on the earth, or implausibly far away."""
        if abs(lat) > 90e7 or abs(lon) > 180e7:
            return None
        place = self.home.to_frame(EarthPlace(lat / 1e7, lon / 1e7, altitude_m))
        if max(map(abs, place)) > MOST_DISTANCE_M:
            return None
        return place._replace(height=max(0.0, place.height))

    def _take_command(self, message: Message) -> None:
        result = self._obey(message)
        self._send(mavlink.MAVLink_command_ack_message(message.command, result))

    def _obey(self, message: Message) -> int:
        reports = self._reports
        orders: dict[int, Callable[[Message], int]] = {
            mavlink.MAV_CMD_COMPONENT_ARM_DISARM: self._obey_arm,
            mavlink.MAV_CMD_DO_SET_MODE: self._obey_mode,
            mavlink.MAV_CMD_NAV_TAKEOFF: self._obey_take_off,
            mavlink.MAV_CMD_NAV_LAND: lambda _message: self._set_mode(Mode.LAND),
            mavlink.MAV_CMD_SET_MESSAGE_INTERVAL: reports.set_interval,
        }
        obey = orders.get(message.command)
        return obey(message) if obey is not None else UNSUPPORTED

    def _obey_arm(self, message: Message) -> int:
        if message.param1 == 0.0:
            if not self.body.on_ground:
                return int(DENIED)
            self.body.armed = False
        elif self.faults.refuses_to_arm or self.faults.fix_type < mavlink.GPS_FIX_TYPE_3D_FIX:
            self._say(mavlink.MAV_SEVERITY_CRITICAL, "PreArm: not ready")
            return int(DENIED)
        else:
            self.arm()
        return int(ACCEPTED)

    def _obey_mode(self, message: Message) -> int:
        if not (math.isfinite(message.param2) and math.isfinite(message.param3)):
            return int(DENIED)
        number = int(message.param2)
        if self.autopilot is PX4:
            number = (number & 0xFF) << 16 | (int(message.param3) & 0xFF) << 24
        return self._set_mode(mode_of(self.autopilot, number))

    def _set_mode(self, mode: Mode | None) -> int:
        if mode is None:
            return int(DENIED)
        if mode is Mode.FOLLOW and self.autopilot is PX4 and self.now_s - self._target_s > 1.0:
            return int(REJECTED)  # PX4 requires targets first
        self._enter(mode)
        return int(ACCEPTED)

    def _obey_take_off(self, message: Message) -> int:
        height_m = message.param7
        is_ready = self.body.armed and self.mode is Mode.FOLLOW and self.body.on_ground
        if self.autopilot is PX4 or not is_ready or not 0.0 < height_m < MOST_DISTANCE_M:
            return int(DENIED)
        self._target = self.body.place._replace(height=height_m)
        self._lifts_s = self.now_s + self.faults.spool_up_s
        return int(ACCEPTED)
