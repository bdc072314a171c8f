"""The shape of a drone, a small quadrocopter: the files of its parts, and its rotors in flight.

The parts are in metres, at the true size; the origin is the middle of the underside. A router's
parts fit into its box; a gateway's are as high as its box, and 0.2 m wide.
"""

from __future__ import annotations

import math
from typing import Tuple

from drone_mesh.drone.roles import Role

MOTORS = ((0.063, 0.063), (-0.063, 0.063), (-0.063, -0.063), (0.063, -0.063))  # x, y
ROTOR_RADIUS_M = 0.037
BLADE_WIDTH_M = 0.012
ROTOR_HIGH_M = 0.074
ROTOR_RAD_PER_S = 9.0  # a real one is a blur

_Place = Tuple[float, float]


def frame_file(is_flying: bool) -> str:
    """The file in meshes/ with hull, arms, motors and legs, and with blades, or discs in flight."""
    return "flying.obj" if is_flying else "standing.obj"


def lamp_file(role: Role) -> str:
    """The file in meshes/ with the part in the colour of the drone's condition."""
    return f"{role.word}_lamp.obj"


def blade_ends(motor: _Place, turned_rad: float) -> tuple[_Place, _Place]:
    """Where the two blades on the motor at this place end."""
    reach_x, reach_y = (ROTOR_RADIUS_M * f(turned_rad) for f in (math.cos, math.sin))
    x, y = motor
    return (x - reach_x, y - reach_y), (x + reach_x, y + reach_y)


def turned_rad(time_s: float, motor: int) -> float:
    """How far the rotor on a motor of a flying drone has turned; two turn each way."""
    turned = math.fmod(ROTOR_RAD_PER_S * time_s, 2 * math.pi)
    return turned if motor % 2 == 0 else -turned
