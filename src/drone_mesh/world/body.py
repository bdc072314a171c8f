"""The body of a drone that physics moves: its limits, and the forces of its motors and the air."""

from __future__ import annotations

import math
from dataclasses import dataclass

from drone_mesh.drone.battery import GRAVITY_M_S2, PowerModel
from drone_mesh.drone.flight_path import Vector


@dataclass(frozen=True)
class BodyLimits:
    """The limits of the body, chosen for a drone of 1 kg with a 5 inch frame."""

    mass_kg: float = 1.0
    drag_n_per_m_s: float = 0.25  # linear: 0.5 N at 2 m/s
    max_acceleration_m_s2: float = 4.0  # in addition to gravity; 4 m/s2 is a tilt of 22 degrees
    max_speed_m_s: float = 5.0  # horizontally
    max_climb_m_s: float = 3.0
    max_sink_m_s: float = 1.5
    power: PowerModel = PowerModel()  # of a drone of that mass
    crash_m_s: float = 1.0  # a change of speed within one step that no motor could cause
    # Something that holds the drone in the air destroys its rotors too. It is recognised by
    # smaller changes of speed:
    held_m_s: float = 0.01  # each above this,
    held_s: float = 0.5  # in every step of this time


POSITION_GAIN_PER_S = 1.2  # m/s of wanted speed per metre of distance
TRIM_GAIN = 1.0  # m/s2 per metre and second
TRIM_WITHIN_M = 0.7  # farther away, it is in flight
MOST_TRIM_M_S2 = 2.0
SPEED_GAIN_PER_S = 4.0  # m/s2 of wanted acceleration per m/s of difference


def controller_force(
    limits: BodyLimits,
    position: Vector,
    velocity: Vector,
    target: Vector,
    trim: Vector = (0.0, 0.0, 0.0),
) -> Vector:
    """The motors' force in newtons towards a target: a speed loop inside a position loop, limited.

    `trim` is the acceleration (m/s2) learnt to compensate for a steady wind.
    """
    wanted = [POSITION_GAIN_PER_S * (goal - here) for here, goal in zip(position, target)]
    horizontal = math.hypot(wanted[0], wanted[1])
    if horizontal > limits.max_speed_m_s:
        share = limits.max_speed_m_s / horizontal
        wanted[0], wanted[1] = wanted[0] * share, wanted[1] * share
    wanted[2] = max(-limits.max_sink_m_s, min(limits.max_climb_m_s, wanted[2]))
    pull = [
        SPEED_GAIN_PER_S * (want - now) + steady
        for want, now, steady in zip(wanted, velocity, trim)
    ]
    size = math.sqrt(sum(part * part for part in pull))
    if size > limits.max_acceleration_m_s2:
        pull = [part * limits.max_acceleration_m_s2 / size for part in pull]
    mass_kg = limits.mass_kg
    return (mass_kg * pull[0], mass_kg * pull[1], mass_kg * (pull[2] + GRAVITY_M_S2))


def learnt_trim(trim: Vector, position: Vector, target: Vector, passed_s: float) -> Vector:
    """The trim after `passed_s`, learnt from the position error; only near the target."""
    if math.dist(position, target) > TRIM_WITHIN_M:
        return trim
    x, y, z = (
        max(-MOST_TRIM_M_S2, min(MOST_TRIM_M_S2, old + TRIM_GAIN * passed_s * (goal - here)))
        for old, here, goal in zip(trim, position, target)
    )
    return (x, y, z)


def drag(limits: BodyLimits, velocity: Vector, wind: Vector) -> Vector:
    """The drag of the air, in newtons."""
    x, y, z = (-limits.drag_n_per_m_s * (now - air) for now, air in zip(velocity, wind))
    return (x, y, z)
