"""Differences between the autopilots: modes, safety parameters, take-off."""

from __future__ import annotations

import struct
from dataclasses import dataclass, field
from typing import Callable, Mapping

from pymavlink.dialects.v20 import ardupilotmega as mavlink


@dataclass(frozen=True)
class Requirement:
    """A parameter of the autopilot that must be set for a flight without a pilot."""

    names: tuple[str, ...]  # in different releases, newest first; one of them exists
    holds: Callable[[float], bool]
    wanted: str  # as text
    for_example: float  # a value that holds


@dataclass(frozen=True)
class Autopilot:
    """One kind of autopilot. Mode numbers are `custom_mode` of its heartbeat."""

    name: str
    mode_names: Mapping[int, str]
    own_mode: int  # the mode in which it follows this program
    hold_mode: int  # the mode that --may-change-mode allows to leave
    land_mode: int
    takes_off_by_command: bool  # otherwise by a target above the ground
    wants_targets_beforehand: bool  # it enters `own_mode` only while targets arrive
    estimate_message: int  # its report on the quality of its position estimate
    integers_as_bytes: bool  # integer parameters are sent as their bytes in place of the float
    requirements: tuple[Requirement, ...] = field(repr=False)
    fence_parameters: tuple[str, ...] = field(repr=False)

    def mode_name(self, mode: int) -> str:
        """The mode's name, or its number."""
        return self.mode_names.get(mode, f"mode {mode}")

    def mode_parameters(self, mode: int) -> tuple[float, float]:
        """Parameters 2 and 3 of MAV_CMD_DO_SET_MODE."""
        if self is PX4:
            return float(mode >> 16 & 0xFF), float(mode >> 24 & 0xFF)
        return float(mode), 0.0

    def parameter_value(self, value: float, kind: int) -> float:
        if not self.integers_as_bytes or kind == mavlink.MAV_PARAM_TYPE_REAL32:
            return value
        return float(struct.unpack("<i", struct.pack("<f", value))[0])


def px4_mode(main: int, sub: int = 0) -> int:
    """PX4's custom_mode (px4_custom_mode.h)."""
    return main << 16 | sub << 24


def _is_on(value: float) -> bool:
    return value != 0


OUR_SYSTEM_ID = 255  # of a ground station: the autopilot's failsafe watches its heartbeat
US = (OUR_SYSTEM_ID, mavlink.MAV_COMP_ID_ONBOARD_COMPUTER)  # QGroundControl is 255, too

ARDUPILOT = Autopilot(
    name="ArduPilot",
    mode_names={
        int(value): name[len("COPTER_MODE_") :]
        for name, value in vars(mavlink).items()
        if name.startswith("COPTER_MODE_") and isinstance(value, int) and "END" not in name
    },
    own_mode=mavlink.COPTER_MODE_GUIDED,
    hold_mode=mavlink.COPTER_MODE_LOITER,
    land_mode=mavlink.COPTER_MODE_LAND,
    takes_off_by_command=True,
    wants_targets_beforehand=False,
    estimate_message=mavlink.MAVLINK_MSG_ID_EKF_STATUS_REPORT,
    integers_as_bytes=False,
    requirements=(
        Requirement(("FS_GCS_ENABLE",), _is_on, "not 0: home, or landing, without this node", 1),
        Requirement(
            ("MAV_GCS_SYSID", "SYSID_MYGCS"),
            lambda value: value == OUR_SYSTEM_ID,
            f"{OUR_SYSTEM_ID}: the node's own system id",
            OUR_SYSTEM_ID,
        ),
        Requirement(("FS_THR_ENABLE",), _is_on, "not 0: it acts when the pilot's radio is lost", 1),
        Requirement(("FS_EKF_ACTION",), _is_on, "not 0: it acts when the position is lost", 1),
        Requirement(("BATT_FS_LOW_ACT",), _is_on, "not 0: it acts on a low battery", 2),
        Requirement(("FENCE_ENABLE",), _is_on, "1: a fence", 1),
        Requirement(("FENCE_ACTION",), _is_on, "not 0: it acts at the fence", 1),
    ),
    fence_parameters=(
        "FENCE_ALT_MAX",
        "FENCE_AUTOENABLE",  # since 4.6; so are the options
        "FENCE_ENABLE",
        "FENCE_OPTIONS",
        "FENCE_RADIUS",
        "FENCE_TYPE",
    ),
)

PX4 = Autopilot(
    name="PX4",
    mode_names={
        px4_mode(1): "MANUAL",
        px4_mode(2): "ALTCTL",
        px4_mode(3): "POSCTL",
        px4_mode(4, 1): "AUTO.READY",
        px4_mode(4, 2): "AUTO.TAKEOFF",
        px4_mode(4, 3): "HOLD",
        px4_mode(4, 4): "AUTO.MISSION",
        px4_mode(4, 5): "AUTO.RTL",
        px4_mode(4, 6): "AUTO.LAND",
        px4_mode(5): "ACRO",
        px4_mode(6): "OFFBOARD",
        px4_mode(7): "STABILIZED",
    },
    own_mode=px4_mode(6),
    hold_mode=px4_mode(4, 3),
    land_mode=px4_mode(4, 6),
    takes_off_by_command=False,
    wants_targets_beforehand=True,
    estimate_message=mavlink.MAVLINK_MSG_ID_ESTIMATOR_STATUS,
    integers_as_bytes=True,
    requirements=(
        Requirement(
            ("COM_OBL_RC_ACT",),
            lambda value: value in (3, 4, 5),
            "3, 4 or 5: it goes home, lands or holds without this node",
            4,
        ),
        Requirement(("COM_OF_LOSS_T",), lambda value: value <= 5.0, "at most 5 s", 1),
        Requirement(("NAV_RCL_ACT",), _is_on, "not 0: it acts when the pilot's radio is lost", 2),
        Requirement(("COM_LOW_BAT_ACT",), _is_on, "not 0: it acts on a low battery", 2),
        Requirement(("GF_ACTION",), _is_on, "not 0: it acts at the fence", 2),
        Requirement(("GF_MAX_HOR_DIST",), _is_on, "not 0: a fence around home", 500),
        Requirement(("GF_MAX_VER_DIST",), _is_on, "not 0: a ceiling", 100),
    ),
    fence_parameters=("GF_ACTION", "GF_MAX_HOR_DIST", "GF_MAX_VER_DIST"),
)


def autopilot_of(heartbeat_autopilot: int) -> Autopilot | None:
    """Look up MAV_AUTOPILOT of a heartbeat; None: not supported."""
    return {
        mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA: ARDUPILOT,
        mavlink.MAV_AUTOPILOT_PX4: PX4,
    }.get(heartbeat_autopilot)
