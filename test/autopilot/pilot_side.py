"""PilotSide: what a pilot does with his ground station, over a connection of its own."""

from __future__ import annotations

import time
from typing import Callable, Sequence

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from drone_mesh.drone.geodesy import EarthPlace
from drone_mesh.drone.mavlink.autopilots import ARDUPILOT
from drone_mesh.drone.mavlink.link import Line, open_line
from drone_mesh.drone.mavlink.telemetry import Message
from drone_mesh.errors import MeshError

SYSTEM_ID = 254  # not the node's: no failsafe watches it
AGAIN_S = 1.0
POLL_S = 0.05
MOST_TEXTS = 200
REPORTS_HZ = {
    mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: 5.0,
    mavlink.MAVLINK_MSG_ID_SYS_STATUS: 2.0,
    mavlink.MAVLINK_MSG_ID_HEARTBEAT: 5.0,
}


class PilotSideError(MeshError):
    """The copter did not do what the pilot wanted; the text says what it said last."""


class PilotSide:
    """Commands one ArduCopter and watches it. One thread uses it."""

    def __init__(self, address: str, system_id: int, within_s: float = 60.0) -> None:
        """Connect, as soon as the copter listens. Raises PilotSideError."""
        self.texts: list[str] = []
        self.parameters: dict[str, float] = {}
        self.answer: Callable[[Message], None] = lambda _: None  # what else to do with a message
        self._system_id = system_id
        self._codec = mavlink.MAVLink(None, SYSTEM_ID, mavlink.MAV_COMP_ID_MISSIONPLANNER)
        self._codec.robust_parsing = True
        self._latest: dict[str, Message] = {}
        self._mission: list[Message] = []
        self._line = _open(address, within_s)
        self.until("a heartbeat", lambda: "HEARTBEAT" in self._latest, within_s)
        for message_id, rate_hz in REPORTS_HZ.items():
            self._command(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, message_id, 1e6 / rate_hz)

    # Reading ---------------------------------------------------------------------------------

    @property
    def mode(self) -> str:
        """The mode of the latest heartbeat, by name."""
        return ARDUPILOT.mode_name(self._latest["HEARTBEAT"].custom_mode)

    @property
    def armed(self) -> bool:
        """Whether it is armed."""
        return bool(self._latest["HEARTBEAT"].base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED)

    @property
    def place(self) -> EarthPlace | None:
        """Where it is; None: not reported yet."""
        position = self._latest.get("GLOBAL_POSITION_INT")
        if position is None:
            return None
        return EarthPlace(position.lat / 1e7, position.lon / 1e7, position.alt / 1e3)

    @property
    def height_m(self) -> float:
        """Above home; 0 if not reported yet."""
        position = self._latest.get("GLOBAL_POSITION_INT")
        return 0.0 if position is None else float(position.relative_alt) / 1e3

    @property
    def heading_deg(self) -> float:
        """Where its nose points, from north over east; 0 if not reported yet."""
        position = self._latest.get("GLOBAL_POSITION_INT")
        return 0.0 if position is None else float(position.hdg) / 100.0

    @property
    def uptime_s(self) -> float:
        """The copter's clock at its latest position, which may run faster than the wall's."""
        position = self._latest.get("GLOBAL_POSITION_INT")
        return 0.0 if position is None else float(position.time_boot_ms) / 1e3

    @property
    def may_arm(self) -> bool:
        """Whether its own checks before arming pass."""
        status = self._latest.get("SYS_STATUS")
        check = mavlink.MAV_SYS_STATUS_PREARM_CHECK
        return status is not None and bool(status.onboard_control_sensors_health & check)

    def read(self, timeout_s: float = POLL_S) -> None:
        """Take in what has arrived. Raises PilotSideError when the copter has gone."""
        try:
            data = self._line.receive(timeout_s)
        except OSError as error:
            raise PilotSideError(f"the copter has gone: {error}") from error
        for message in self._codec.parse_buffer(data) or ():
            if message.get_srcSystem() == self._system_id:
                self._take(message)

    def until(
        self,
        what: str,
        holds: Callable[[], bool],
        within_s: float = 60.0,
        meanwhile: Callable[[], None] | None = None,
    ) -> None:
        """Read until it holds, and call `meanwhile` once a second. Raises PilotSideError."""
        end_s, again_s = time.monotonic() + within_s, 0.0
        while not holds():
            now_s = time.monotonic()
            if now_s > end_s:
                said = "; ".join(self.texts[-3:]) or "nothing"
                raise PilotSideError(f"copter {self._system_id}: not {what}; it said: {said}")
            if meanwhile is not None and now_s >= again_s:
                again_s = now_s + AGAIN_S
                meanwhile()
            self.read()

    # Commanding ------------------------------------------------------------------------------

    def choose(self, mode: str, within_s: float = 60.0) -> None:
        """Choose a mode by name, until it is in it. Raises PilotSideError."""
        number = next(n for n, name in ARDUPILOT.mode_names.items() if name == mode)
        flags = float(mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED)
        self.until(
            f"in {mode}",
            lambda: self.mode == mode,
            within_s,
            lambda: self._command(mavlink.MAV_CMD_DO_SET_MODE, flags, float(number)),
        )

    def set(self, name: str, value: float, within_s: float = 20.0) -> None:
        """Set a parameter, until it is confirmed. Raises PilotSideError."""
        self.parameters.pop(name, None)
        request = mavlink.MAVLink_param_set_message(
            self._system_id, 1, name.encode(), value, mavlink.MAV_PARAM_TYPE_REAL32
        )
        self.until(
            f"confirming {name}",
            lambda: name in self.parameters,
            within_s,
            lambda: self._send(request),
        )

    def make_ready(self, within_s: float = 120.0) -> None:
        """Until it would arm, in GUIDED: given to the mesh. Raises PilotSideError."""
        self.until("ready to arm", lambda: self.may_arm, within_s)
        self.choose("GUIDED", within_s)

    def upload(self, way: Sequence[EarthPlace], within_s: float = 20.0) -> None:
        """A mission along these places, for AUTO. Raises PilotSideError."""
        items = [way[0], *way]  # the first is home and not flown to
        waypoint = mavlink.MAV_CMD_NAV_WAYPOINT
        self._upload([(waypoint, 0.0, place) for place in items], 0, within_s)

    def upload_fence(
        self, items: Sequence[tuple[int, float, EarthPlace]], within_s: float = 20.0
    ) -> None:
        """MAV_CMD_NAV_FENCE_..., corners or radius in m, and where. Raises PilotSideError."""
        self._upload(items, mavlink.MAV_MISSION_TYPE_FENCE, within_s)

    def _upload(
        self, items: Sequence[tuple[int, float, EarthPlace]], kind: int, within_s: float
    ) -> None:
        to = self._system_id, 1
        self._latest.pop("MISSION_ACK", None)
        self._mission = [
            mavlink.MAVLink_mission_item_int_message(
                *(*to, number, mavlink.MAV_FRAME_GLOBAL_INT, command, 0, 1, size, 0.0, 0.0, 0.0),
                *(round(place.latitude_deg * 1e7), round(place.longitude_deg * 1e7)),
                *(place.altitude_m, kind),
            )
            for number, (command, size, place) in enumerate(items)
        ]
        self._send(mavlink.MAVLink_mission_count_message(*to, len(items), kind))
        self.until("taking the upload", lambda: "MISSION_ACK" in self._latest, within_s)

    def close(self) -> None:
        """Close the connection."""
        self._line.close()

    def send(self, message: Message) -> None:
        """Any other message of a ground station."""
        self._send(message)

    def _take(self, message: Message) -> None:
        kind = message.get_type()
        self._latest[kind] = message
        if kind == "STATUSTEXT":
            self.texts = [*self.texts[1 - MOST_TEXTS :], str(message.text)]
        elif kind in ("MISSION_REQUEST", "MISSION_REQUEST_INT"):
            if message.seq < len(self._mission):
                self._send(self._mission[message.seq])
        elif kind == "PARAM_VALUE":
            self.parameters[message.param_id] = float(message.param_value)
        else:
            self.answer(message)

    def _command(self, command: int, *parameters: float) -> None:
        padded = (*parameters, *(0.0,) * (7 - len(parameters)))
        self._send(mavlink.MAVLink_command_long_message(self._system_id, 1, command, 0, *padded))

    def _send(self, message: Message) -> None:
        try:
            self._line.send(message.pack(self._codec))
        except OSError as error:
            raise PilotSideError(f"the copter has gone: {error}") from error
        self._codec.seq = (self._codec.seq + 1) % 256


def _open(address: str, within_s: float) -> Line:
    end_s = time.monotonic() + within_s
    while True:
        try:
            return open_line(address)
        except OSError as error:
            if time.monotonic() > end_s:
                raise PilotSideError(f"{address}: {error}") from error
            time.sleep(POLL_S)
