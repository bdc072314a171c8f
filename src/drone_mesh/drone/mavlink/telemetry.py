"""The reports of an autopilot, and their age."""

from __future__ import annotations

import math
from typing import Any, Callable

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from drone_mesh.drone.geodesy import EarthPlace
from drone_mesh.drone.mavlink.autopilots import Autopilot, autopilot_of

Message = Any  # one of pymavlink's generated classes

HEARTBEAT_LOST_S = 3.0  # of the autopilot, at 1 Hz: three are missing
FRESH_S = 2.0  # a position, and the reports of its quality
STATUS_FRESH_S = 10.0  # battery, landed state, fence
STICKS_MOVED_US = 100  # a fifth of the travel; trim and noise are below a tenth of this
STICKS_REST_S = 5.0  # time after its last movement until a stick counts as released

FIX_3D = mavlink.GPS_FIX_TYPE_3D_FIX
GOOD_ESTIMATE = (
    mavlink.EKF_ATTITUDE
    | mavlink.EKF_VELOCITY_HORIZ
    | mavlink.EKF_POS_HORIZ_ABS
    | mavlink.EKF_POS_VERT_ABS
)  # the same bits in EKF_STATUS_REPORT and ESTIMATOR_STATUS
BAD_EKF = mavlink.EKF_CONST_POS_MODE
BAD_ESTIMATOR = mavlink.ESTIMATOR_CONST_POS_MODE | mavlink.ESTIMATOR_GPS_GLITCH
FENCE_SENSOR = mavlink.MAV_SYS_STATUS_GEOFENCE

MULTIROTORS = frozenset(
    (
        mavlink.MAV_TYPE_QUADROTOR,
        mavlink.MAV_TYPE_HEXAROTOR,
        mavlink.MAV_TYPE_OCTOROTOR,
        mavlink.MAV_TYPE_TRICOPTER,
        mavlink.MAV_TYPE_COAXIAL,
        mavlink.MAV_TYPE_DODECAROTOR,
        mavlink.MAV_TYPE_DECAROTOR,
    )
)  # mode numbers of other vehicles have other meanings

HEARTBEAT_HZ = 2.0  # on a line that loses one in twenty, 3 s without any are rare

STREAMS_HZ = {
    mavlink.MAVLINK_MSG_ID_HEARTBEAT: HEARTBEAT_HZ,
    mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: 5.0,
    mavlink.MAVLINK_MSG_ID_GPS_RAW_INT: 4.0,
    mavlink.MAVLINK_MSG_ID_SYS_STATUS: 1.0,
    mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: 2.0,
    mavlink.MAVLINK_MSG_ID_RC_CHANNELS: 2.0,
    mavlink.MAVLINK_MSG_ID_HOME_POSITION: 0.5,
    mavlink.MAVLINK_MSG_ID_FENCE_STATUS: 1.0,
}  # requested from the autopilot, besides the quality of its estimate
ESTIMATE_HZ = 4.0


def sender_of(message: Message) -> tuple[int, int]:
    """The system and the component that sent a message."""
    return message.get_srcSystem(), message.get_srcComponent()


class Telemetry:
    """The latest report of one autopilot on each subject. Times are of the caller's clock."""

    def __init__(self) -> None:
        self.autopilot: Autopilot | None = None  # None until one was heard
        self.sender = (0, 0)  # its system and component
        self.heartbeat_s = -math.inf
        self.mode = -1  # custom_mode
        self.armed = False
        self.failsafe = False
        self.home: EarthPlace | None = None
        self._other_vehicle = False  # an unsupported autopilot was heard
        self._place: EarthPlace | None = None
        self._place_s = -math.inf
        self._fix = 0
        self._fix_s = -math.inf
        self._estimate_good = False
        self._estimate_s = -math.inf
        self._battery_percent: float | None = None
        self._battery_s = -math.inf
        self._landed = mavlink.MAV_LANDED_STATE_UNDEFINED
        self._landed_s = -math.inf
        self.keeps_fence = self.is_outside_fence = False  # as the autopilot reports
        self._sticks_at_rest: tuple[int, ...] | None = None
        self._sticks_moved_s = -math.inf
        self._readers: dict[str, Callable[[Message, float], None]] = {
            "HEARTBEAT": self._take_heartbeat,
            "GLOBAL_POSITION_INT": self._take_position,
            "GPS_RAW_INT": self._take_fix,
            "EKF_STATUS_REPORT": self._take_ekf,
            "ESTIMATOR_STATUS": self._take_estimator,
            "SYS_STATUS": self._take_status,
            "EXTENDED_SYS_STATE": self._take_landed,
            "HOME_POSITION": self._take_home,
            "FENCE_STATUS": self._take_fence,
            "RC_CHANNELS": self._take_sticks,
        }

    def on_message(self, message: Message, now_s: float) -> bool:
        """Store a message; False if another system sent it, or an autopilot not identified yet."""
        is_heartbeat = message.get_type() == "HEARTBEAT"
        if is_heartbeat and self.autopilot is None:
            if message.type in MULTIROTORS:
                self.autopilot = autopilot_of(message.autopilot)
            if message.get_srcComponent() == mavlink.MAV_COMP_ID_AUTOPILOT1:
                self._other_vehicle = self.autopilot is None
            self.sender = sender_of(message)
        if self.autopilot is None or sender_of(message) != self.sender:
            return False
        read = self._readers.get(message.get_type())
        if read is not None:
            read(message, now_s)
        return True

    # Conclusions -----------------------------------------------------------------------------

    def link_trouble(self, now_s: float) -> str:
        """Why the autopilot is unreliable now; empty if it is not."""
        if self.autopilot is None:
            if self._other_vehicle:
                return "the vehicle is not a multirotor with ArduPilot or PX4"
            return "no heartbeat from an ArduPilot or PX4 autopilot yet"
        silence_s = now_s - self.heartbeat_s
        if silence_s > HEARTBEAT_LOST_S:
            return "no heartbeat from the autopilot for more than 3 s"
        return ""

    def position_trouble(self, now_s: float) -> str:
        """Why the position is unusable now; empty if it is usable."""
        if now_s - self._fix_s > FRESH_S:
            return "no report from the GPS for more than 2 s"
        if self._fix < FIX_3D:
            return "the GPS has no 3D fix"
        if now_s - self._estimate_s > FRESH_S:
            return "no report from the position estimator for more than 2 s"
        if not self._estimate_good:
            return "the autopilot does not trust its position estimate"
        if self._place is None or now_s - self._place_s > FRESH_S:
            return "no position for more than 2 s"
        return ""

    def place(self, now_s: float) -> EarthPlace | None:
        """The drone's position; None while `position_trouble` has a reason."""
        return None if self.position_trouble(now_s) else self._place

    def battery_percent(self, now_s: float) -> float | None:
        """The remaining charge; None: not reported."""
        return self._battery_percent if now_s - self._battery_s <= STATUS_FRESH_S else None

    def on_ground(self, now_s: float) -> bool | None:
        """Whether it is on the ground; None: not reported."""
        if (
            now_s - self._landed_s > STATUS_FRESH_S
            or self._landed == mavlink.MAV_LANDED_STATE_UNDEFINED
        ):
            return None
        return bool(self._landed == mavlink.MAV_LANDED_STATE_ON_GROUND)

    def sticks_moved(self, now_s: float) -> bool:
        """Whether a stick of the pilot's transmitter has moved recently."""
        return now_s - self._sticks_moved_s <= STICKS_REST_S

    def streams_missing(self, now_s: float) -> bool:
        """Whether a report that a flight needs is missing, or comes too seldom."""
        if now_s - self.heartbeat_s > 1.5 / HEARTBEAT_HZ:
            return True
        times = (self._fix_s, self._estimate_s, self._place_s, self._battery_s, self._landed_s)
        return self.home is None or any(now_s - then > FRESH_S for then in times)

    # The messages ----------------------------------------------------------------------------

    def _take_heartbeat(self, message: Message, now_s: float) -> None:
        self.heartbeat_s = now_s
        self.mode = message.custom_mode
        self.armed = bool(message.base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED)
        self.failsafe = message.system_status in (
            mavlink.MAV_STATE_CRITICAL,
            mavlink.MAV_STATE_EMERGENCY,
            mavlink.MAV_STATE_FLIGHT_TERMINATION,
        )

    def _take_position(self, message: Message, now_s: float) -> None:
        place = _on_earth(message.lat, message.lon, message.alt)
        if place is not None:
            self._place, self._place_s = place, now_s

    def _take_fix(self, message: Message, now_s: float) -> None:
        self._fix = message.fix_type
        self._fix_s = now_s

    def _take_ekf(self, message: Message, now_s: float) -> None:
        self._take_estimate(message.flags, BAD_EKF, now_s)

    def _take_estimator(self, message: Message, now_s: float) -> None:
        self._take_estimate(message.flags, BAD_ESTIMATOR, now_s)

    def _take_estimate(self, flags: int, bad: int, now_s: float) -> None:
        self._estimate_good = flags & GOOD_ESTIMATE == GOOD_ESTIMATE and not flags & bad
        self._estimate_s = now_s

    def _take_status(self, message: Message, now_s: float) -> None:
        remaining = message.battery_remaining  # percent; -1: unknown
        self._battery_percent = float(remaining) if 0 <= remaining <= 100 else None
        self._battery_s = now_s
        health = message.onboard_control_sensors_health
        kept = self.keeps_fence
        self.keeps_fence = bool(message.onboard_control_sensors_enabled & FENCE_SENSOR)
        if kept or self.keeps_fence:  # switched off, no breach of it is left
            self.is_outside_fence = self.keeps_fence and not health & FENCE_SENSOR

    def _take_landed(self, message: Message, now_s: float) -> None:
        self._landed = message.landed_state
        self._landed_s = now_s

    def _take_home(self, message: Message, _now_s: float) -> None:
        self.home = _on_earth(message.latitude, message.longitude, message.altitude)

    def _take_fence(self, message: Message, _now_s: float) -> None:
        self.is_outside_fence = bool(message.breach_status)

    def _take_sticks(self, message: Message, now_s: float) -> None:
        sticks = (message.chan1_raw, message.chan2_raw, message.chan3_raw, message.chan4_raw)
        if message.chancount < len(sticks) or not all(800 <= us <= 2200 for us in sticks):
            return  # no transmitter is connected
        rest = self._sticks_at_rest
        if rest is None:
            self._sticks_at_rest = sticks
        elif any(abs(us - at_rest) > STICKS_MOVED_US for us, at_rest in zip(sticks, rest)):
            self._sticks_moved_s = now_s
            self._sticks_at_rest = sticks


def _on_earth(latitude_e7: int, longitude_e7: int, altitude_mm: int) -> EarthPlace | None:
    place = EarthPlace(latitude_e7 / 1e7, longitude_e7 / 1e7, altitude_mm / 1e3)
    possible = abs(place.latitude_deg) <= 90.0 and abs(place.longitude_deg) <= 180.0
    return place if possible else None
