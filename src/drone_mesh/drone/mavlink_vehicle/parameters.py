"""The parameters of the simulated vehicle; initially a safe set."""

from __future__ import annotations

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from drone_mesh.drone.mavlink.autopilots import OUR_SYSTEM_ID, PX4, Autopilot

INTEGER = mavlink.MAV_PARAM_TYPE_INT32
REAL = mavlink.MAV_PARAM_TYPE_REAL32

_ARDUPILOT = {
    "BATT_FS_LOW_ACT": (1.0, INTEGER),
    "FENCE_ACTION": (1.0, INTEGER),
    "FENCE_ENABLE": (1.0, INTEGER),
    "FS_EKF_ACTION": (1.0, INTEGER),
    "FS_GCS_ENABLE": (5.0, INTEGER),  # land
    "FS_THR_ENABLE": (1.0, INTEGER),
    "SYSID_MYGCS": (float(OUR_SYSTEM_ID), INTEGER),
}
_PX4 = {
    "COM_LOW_BAT_ACT": (2.0, INTEGER),
    "COM_OBL_RC_ACT": (4.0, INTEGER),  # land
    "COM_OF_LOSS_T": (1.0, REAL),
    "GF_ACTION": (2.0, INTEGER),
    "GF_MAX_HOR_DIST": (1000.0, REAL),
    "GF_MAX_VER_DIST": (120.0, REAL),
    "MIS_TAKEOFF_ALT": (2.5, REAL),
    "NAV_RCL_ACT": (2.0, INTEGER),
}


class Parameters:
    """Names, values and types, as MAVLink has them."""

    def __init__(self, autopilot: Autopilot) -> None:
        self._autopilot = autopilot
        self._all = dict(_PX4 if autopilot is PX4 else _ARDUPILOT)

    def __getitem__(self, name: str) -> float:
        return self._all[name][0]

    def __setitem__(self, name: str, value: float) -> None:
        self._all[name] = (value, self._all[name][1])

    def __contains__(self, name: str) -> bool:
        return name in self._all

    def names(self) -> list[str]:
        """All names, in the order of their indices."""
        return sorted(self._all)

    def message(self, name: str) -> mavlink.MAVLink_param_value_message:
        """The PARAM_VALUE of a parameter."""
        value, kind = self._all[name]
        names = self.names()
        return mavlink.MAVLink_param_value_message(
            name.encode(),
            self._autopilot.parameter_bytes(value, kind),
            kind,
            len(names),
            names.index(name),
        )

    def take(self, name: str, raw: float) -> None:
        """Apply a PARAM_SET for an existing parameter."""
        kind = self._all[name][1]
        self._all[name] = (self._autopilot.parameter_value(raw, kind), kind)
