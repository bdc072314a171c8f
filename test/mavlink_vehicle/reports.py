"""The messages of the simulated vehicle about itself, each at its own rate."""

from __future__ import annotations

import functools
import math
from typing import Callable, Protocol

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from drone_mesh.drone.geodesy import Origin
from drone_mesh.drone.mavlink.autopilots import PX4, Autopilot
from drone_mesh.drone.mavlink.telemetry import (
    BAD_EKF,
    FENCE_SENSOR,
    GOOD_ESTIMATE,
    Message,
)
from mavlink_vehicle.body import Body, VehicleFaults
from mavlink_vehicle.modes import Mode, mode_number
from mavlink_vehicle.parameters import Parameters

SENSORS = (
    mavlink.MAV_SYS_STATUS_SENSOR_3D_GYRO
    | mavlink.MAV_SYS_STATUS_SENSOR_3D_ACCEL
    | mavlink.MAV_SYS_STATUS_SENSOR_3D_MAG
    | mavlink.MAV_SYS_STATUS_SENSOR_ABSOLUTE_PRESSURE
    | mavlink.MAV_SYS_STATUS_SENSOR_GPS
    | mavlink.MAV_SYS_STATUS_PREARM_CHECK
)
FULL_CELL_MV, EMPTY_CELL_MV, CELLS = 4200, 3300, 4


class Reported(Protocol):
    """The state that the reports describe."""

    autopilot: Autopilot
    home: Origin
    body: Body
    faults: VehicleFaults
    parameters: Parameters
    mode: Mode
    in_failsafe: bool
    now_s: float


class Reports:
    """Schedules the messages. An interval of 0 or less: not sent."""

    def __init__(self, vehicle: Reported) -> None:
        self._vehicle = vehicle
        is_px4 = vehicle.autopilot is PX4
        estimate = self._estimator if is_px4 else self._ekf
        self._makers: dict[int, Callable[[], Message]] = {
            mavlink.MAVLINK_MSG_ID_HEARTBEAT: self._heartbeat,
            mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: self._position,
            mavlink.MAVLINK_MSG_ID_GPS_RAW_INT: self._gps,
            vehicle.autopilot.estimate_message: estimate,
            mavlink.MAVLINK_MSG_ID_SYS_STATUS: self._status,
            mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: self._landed,
            mavlink.MAVLINK_MSG_ID_HOME_POSITION: self._home,
            mavlink.MAVLINK_MSG_ID_RC_CHANNELS: self._sticks,
        }
        # Two messages want it, and while the drone stands or hovers it is the same.
        self._on_earth = functools.lru_cache(maxsize=1)(vehicle.home.to_earth)
        self._interval_s = {message_id: 1.0 for message_id in self._makers}
        self._due_s = {message_id: -math.inf for message_id in self._makers}
        self._boot_s = math.nan

    def set_interval(self, message: Message) -> int:
        """MAV_CMD_SET_MESSAGE_INTERVAL: 0: default, below 0: never.

        Returns a MAV_RESULT, as all commands do.
        """
        if not math.isfinite(message.param1):
            return int(mavlink.MAV_RESULT_DENIED)
        message_id, interval_us = int(message.param1), message.param2
        if message_id not in self._makers or not math.isfinite(interval_us):
            return int(mavlink.MAV_RESULT_UNSUPPORTED)
        self._interval_s[message_id] = 1.0 if interval_us == 0 else interval_us / 1e6
        return int(mavlink.MAV_RESULT_ACCEPTED)

    def due(self, now_s: float) -> list[Message]:
        """The messages due now."""
        if math.isnan(self._boot_s):
            self._boot_s = now_s
        messages = []
        for message_id, due_s in self._due_s.items():
            interval_s = self._interval_s[message_id]
            if interval_s > 0.0 and now_s >= due_s:
                self._due_s[message_id] = max(due_s, now_s - interval_s) + interval_s
                messages.append(self._makers[message_id]())
        if self._vehicle.faults.positions_stop:
            stopped = "GLOBAL_POSITION_INT"
            messages = [m for m in messages if m.get_type() != stopped]
        return messages

    def _ms(self) -> int:
        boot_s = 0.0 if math.isnan(self._boot_s) else self._boot_s
        return int((self._vehicle.now_s - boot_s) * 1000)

    def _heartbeat(self) -> Message:
        vehicle = self._vehicle
        flags = mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED | mavlink.MAV_MODE_FLAG_STABILIZE_ENABLED
        if vehicle.body.armed:
            flags |= mavlink.MAV_MODE_FLAG_SAFETY_ARMED
        if vehicle.in_failsafe:
            state = mavlink.MAV_STATE_CRITICAL
        elif vehicle.body.armed:
            state = mavlink.MAV_STATE_ACTIVE
        else:
            state = mavlink.MAV_STATE_STANDBY
        autopilot = (
            mavlink.MAV_AUTOPILOT_PX4
            if vehicle.autopilot is PX4
            else mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA
        )
        mode = mode_number(vehicle.autopilot, vehicle.mode)
        return mavlink.MAVLink_heartbeat_message(
            mavlink.MAV_TYPE_QUADROTOR, autopilot, flags, mode, state, 3
        )

    def _position(self) -> Message:
        vehicle = self._vehicle
        place = self._on_earth(vehicle.body.place)
        north, east, up = vehicle.body.velocity
        return mavlink.MAVLink_global_position_int_message(
            self._ms(),
            round(place.latitude_deg * 1e7),
            round(place.longitude_deg * 1e7),
            round(place.altitude_m * 1e3),
            round(vehicle.body.place.height * 1e3),
            round(north * 100),
            round(east * 100),
            round(-up * 100),
            0,
        )

    def _gps(self) -> Message:
        vehicle = self._vehicle
        place = self._on_earth(vehicle.body.place)
        return mavlink.MAVLink_gps_raw_int_message(
            int(vehicle.now_s * 1e6),
            vehicle.faults.fix_type,
            round(place.latitude_deg * 1e7),
            round(place.longitude_deg * 1e7),
            round(place.altitude_m * 1e3),
            80,
            100,
            0,
            0,
            14,
        )

    def _estimate_flags(self) -> int:
        if self._vehicle.faults.estimate_good:
            return int(GOOD_ESTIMATE | mavlink.EKF_VELOCITY_VERT | mavlink.EKF_POS_HORIZ_REL)
        return int(mavlink.EKF_ATTITUDE | BAD_EKF)

    def _ekf(self) -> Message:
        return mavlink.MAVLink_ekf_status_report_message(
            self._estimate_flags(), 0.1, 0.1, 0.1, 0.1, 0.0
        )

    def _estimator(self) -> Message:
        return mavlink.MAVLink_estimator_status_message(
            int(self._vehicle.now_s * 1e6), self._estimate_flags(), *(0.1,) * 8
        )

    def _status(self) -> Message:
        vehicle = self._vehicle
        percent = vehicle.body.battery_percent
        cell_mv = EMPTY_CELL_MV + (FULL_CELL_MV - EMPTY_CELL_MV) * percent / 100.0
        healthy = SENSORS if vehicle.faults.fence_breached else SENSORS | FENCE_SENSOR
        keeps_fence = vehicle.faults.fence_on or vehicle.parameters.get("FENCE_ENABLE", 1.0)
        return mavlink.MAVLink_sys_status_message(
            SENSORS | FENCE_SENSOR,
            SENSORS | FENCE_SENSOR if keeps_fence else SENSORS,
            healthy,
            200,
            round(cell_mv * CELLS),
            -1,
            math.ceil(percent) if vehicle.faults.battery_known else -1,
            *(0,) * 6,
        )

    def _landed(self) -> Message:
        state = (
            mavlink.MAV_LANDED_STATE_ON_GROUND
            if self._vehicle.body.on_ground
            else mavlink.MAV_LANDED_STATE_IN_AIR
        )
        return mavlink.MAVLink_extended_sys_state_message(mavlink.MAV_VTOL_STATE_UNDEFINED, state)

    def _home(self) -> Message:
        home = self._vehicle.home
        return mavlink.MAVLink_home_position_message(
            round(home.latitude_deg * 1e7),
            round(home.longitude_deg * 1e7),
            round(home.altitude_m * 1e3),
            *(0.0,) * 3,
            [1.0, 0.0, 0.0, 0.0],
            *(0.0,) * 3,
        )

    def _sticks(self) -> Message:
        channels = [self._vehicle.faults.stick_us, 1500, 1500, 1500] + [0] * 14
        return mavlink.MAVLink_rc_channels_message(self._ms(), 4, *channels, 200)
