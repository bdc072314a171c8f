"""The shape of a drone: a small quadrocopter, in parts of different colours.

Metres, at the true size; the origin is the middle of the underside. A router's parts fit into its
box; a gateway's are as high as its box, and 0.2 m wide.
"""

from __future__ import annotations

import enum
import math
from typing import Tuple

from drone_mesh.drone.roles import Role
from drone_mesh.view.solids import Solid, bar, dome, polygon, prism

MOTORS = ((0.063, 0.063), (-0.063, 0.063), (-0.063, -0.063), (0.063, -0.063))  # x, y
ROTOR_RADIUS_M = 0.037
BLADE_WIDTH_M = 0.012
ROTOR_LOW_M, ROTOR_HIGH_M = 0.070, 0.074
DISC_HIGH_M = 0.072
ROTOR_RAD_PER_S = 9.0  # a real one is a blur

_Place = Tuple[float, float]


class BodyPart(enum.Enum):
    """A part with its own colour."""

    FRAME = "frame"  # hull, arms, motors and legs
    LAMP = "lamp"  # in the colour of the drone's condition
    BLADES = "blades"  # of the rotors, at rest
    DISCS = "discs"  # the rotors as they look in flight


def solid_of(role: Role, part: BodyPart) -> Solid:
    """The triangles of a part of a drone."""
    if part is BodyPart.FRAME:
        return _frame()
    if part is BodyPart.LAMP:
        return _gateway_lamp() if role is Role.GATEWAY else _router_lamp()
    if part is BodyPart.BLADES:
        return [triangle for motor in range(4) for triangle in rotor(motor, 0.6 + 0.9 * motor)]
    discs = (polygon(motor, ROTOR_RADIUS_M, 12) for motor in MOTORS)
    return [t for disc in discs for t in prism(disc, ROTOR_LOW_M, DISC_HIGH_M)]


def rotor(motor: int, turned_rad: float) -> Solid:
    """The two blades on one motor."""
    blades = bar(*blade_ends(MOTORS[motor], turned_rad), BLADE_WIDTH_M)
    return prism(blades, ROTOR_LOW_M, ROTOR_HIGH_M)


def blade_ends(motor: _Place, turned_rad: float) -> tuple[_Place, _Place]:
    """Where the two blades on the motor at this place end."""
    reach_x, reach_y = (ROTOR_RADIUS_M * f(turned_rad) for f in (math.cos, math.sin))
    x, y = motor
    return (x - reach_x, y - reach_y), (x + reach_x, y + reach_y)


def turned_rad(time_s: float, motor: int) -> float:
    """How far the rotor on a motor of a flying drone has turned; two turn each way."""
    turned = math.fmod(ROTOR_RAD_PER_S * time_s, 2 * math.pi)
    return turned if motor % 2 == 0 else -turned


def _frame() -> Solid:
    solid = prism(polygon((0.0, 0.0), 0.05, 8), 0.028, 0.056)
    for x, y in MOTORS:
        solid += prism(bar((0.0, 0.0), (x, y), 0.014), 0.04, 0.052)
        solid += prism(polygon((x, y), 0.012, 6), 0.038, 0.07)
        solid += prism(polygon((0.8 * x, 0.8 * y), 0.006, 4), 0.0, 0.042)
    return solid


def _router_lamp() -> Solid:
    return dome(0.056, 0.056, 0.1, corners=12, rings=4)


def _gateway_lamp() -> Solid:
    """A square hull and a mast with its aerial."""
    hull = prism(polygon((0.0, 0.0), 0.075, 4, math.pi / 4), 0.056, 0.1)
    mast = prism(polygon((0.0, 0.0), 0.012, 6), 0.1, 0.17)
    return hull + mast + prism(polygon((0.0, 0.0), 0.034, 8), 0.17, 0.2)
