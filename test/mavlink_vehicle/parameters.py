"""The parameters of the simulated vehicle; initially a safe set."""

from __future__ import annotations

import struct
from typing import Callable, Dict

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from drone_mesh.drone.mavlink.autopilots import OUR_SYSTEM_ID, PX4, Autopilot
from drone_mesh.drone.mavlink.telemetry import Message

_ARDUPILOT = {
    "BATT_FS_LOW_ACT": 1.0,
    "FENCE_ACTION": 1.0,
    "FENCE_ALT_MAX": 100.0,
    "FENCE_AUTOENABLE": 0.0,
    "FENCE_ENABLE": 1.0,
    "FENCE_OPTIONS": 0.0,
    "FENCE_RADIUS": 300.0,
    "FENCE_TYPE": 4.0,  # areas, of which there are none at first
    "FS_EKF_ACTION": 1.0,
    "FS_GCS_ENABLE": 5.0,  # land
    "FS_OPTIONS": 16.0,  # the default: its node may be lost while its pilot flies
    "FS_THR_ENABLE": 1.0,
    "SYSID_MYGCS": float(OUR_SYSTEM_ID),
}
_PX4 = {
    "COM_LOW_BAT_ACT": 2.0,
    "COM_OBL_RC_ACT": 4.0,  # land
    "COM_OF_LOSS_T": 1.0,
    "GF_ACTION": 2.0,
    "GF_MAX_HOR_DIST": 1000.0,
    "GF_MAX_VER_DIST": 120.0,
    "NAV_RCL_ACT": 2.0,
}
_REAL = ("COM_OF_LOSS_T", "GF_MAX_HOR_DIST", "GF_MAX_VER_DIST")


class Parameters(Dict[str, float]):
    """Values by name; those that are not real are integers. Answers requests through `send`."""

    def __init__(self, autopilot: Autopilot, send: Callable[[Message], None]) -> None:
        super().__init__(_PX4 if autopilot is PX4 else _ARDUPILOT)
        self._autopilot = autopilot
        self._send = send

    def names(self) -> list[str]:
        """All names, in the order of their indices."""
        return sorted(self)

    def take_read_request(self, message: Message) -> None:
        """PARAM_REQUEST_READ."""
        names = self.names()
        if 0 <= message.param_index < len(names):
            self._report(names[message.param_index])
        elif message.param_id in self:
            self._report(message.param_id)

    def _report(self, name: str) -> None:
        kind, names = _kind(name), self.names()
        value = self[name]
        if self._autopilot.integers_as_bytes and kind != mavlink.MAV_PARAM_TYPE_REAL32:
            value = float(struct.unpack("<f", struct.pack("<i", int(value)))[0])
        self._send(
            mavlink.MAVLink_param_value_message(
                name.encode(), value, kind, len(names), names.index(name)
            )
        )


def _kind(name: str) -> int:
    return int(mavlink.MAV_PARAM_TYPE_REAL32 if name in _REAL else mavlink.MAV_PARAM_TYPE_INT32)
