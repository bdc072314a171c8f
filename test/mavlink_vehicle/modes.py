"""The modes of the simulated vehicle, for each kind of autopilot."""

from __future__ import annotations

import enum

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from drone_mesh.drone.mavlink.autopilots import ARDUPILOT, PX4, Autopilot, px4_mode


class Mode(enum.Enum):
    """The activity of the vehicle's autopilot."""

    PILOT = "its pilot flies"
    HOLD = "holds its position"
    FOLLOW = "follows targets"  # GUIDED, OFFBOARD
    LAND = "lands"
    RETURN = "returns home and lands"


_NUMBERS = {
    ARDUPILOT.name: {
        Mode.PILOT: mavlink.COPTER_MODE_STABILIZE,
        Mode.HOLD: mavlink.COPTER_MODE_LOITER,
        Mode.FOLLOW: mavlink.COPTER_MODE_GUIDED,
        Mode.LAND: mavlink.COPTER_MODE_LAND,
        Mode.RETURN: mavlink.COPTER_MODE_RTL,
    },
    PX4.name: {
        Mode.PILOT: px4_mode(3),
        Mode.HOLD: px4_mode(4, 3),
        Mode.FOLLOW: px4_mode(6),
        Mode.LAND: px4_mode(4, 6),
        Mode.RETURN: px4_mode(4, 5),
    },
}


def mode_number(autopilot: Autopilot, mode: Mode) -> int:
    """`custom_mode` of this mode."""
    return int(_NUMBERS[autopilot.name][mode])


def mode_of(autopilot: Autopilot, number: int) -> Mode | None:
    """The mode with this `custom_mode`; None if the vehicle does not have it."""
    modes = _NUMBERS[autopilot.name].items()
    return next((mode for mode, its_number in modes if its_number == number), None)
