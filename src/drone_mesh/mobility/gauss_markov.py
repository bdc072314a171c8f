"""Gauss-Markov: speed and direction change gradually, with a memory."""

from __future__ import annotations

import math
import random
from typing import Iterator

from drone_mesh.drone.flight_path import Vector
from drone_mesh.mobility.area import Area
from drone_mesh.mobility.settings import Mobility
from drone_mesh.mobility.track import Legs, Segment

TURN_RAD = 1.0  # standard deviation of the direction around the drone's mean direction


def gauss_markov(mobility: Mobility, area: Area, start: Vector, rng: random.Random) -> Legs:
    """A drone that starts at `start`, or where the area is nearest to it (Liang, Haas 1999).

    The speed is normal around the middle of the range, with 95 % of it within the range, and never
    negative. At the edge of the area the drone is reflected, and its mean direction with it.
    """
    return Legs(_legs(mobility, area, start, rng))


def _legs(mobility: Mobility, area: Area, start: Vector, rng: random.Random) -> Iterator[Segment]:
    low, high = mobility.speed_m_s
    mean_m_s, sigma_m_s = mobility.mean_speed_m_s, (high - low) / 4
    alpha, step_s = mobility.alpha, mobility.update_s
    fresh = math.sqrt(1 - alpha**2)
    towards_rad = rng.uniform(-math.pi, math.pi)
    mirrored = [1.0, 1.0]  # x and y: -1 after an odd number of reflections
    speed_m_s, turn_rad = rng.gauss(mean_m_s, sigma_m_s), rng.gauss(0.0, TURN_RAD)
    at_s = 0.0
    place = [_within(start[0], area.x, area.width_m), _within(start[1], area.y, area.depth_m)]
    sides = ((area.x, area.x + area.width_m), (area.y, area.y + area.depth_m))
    while True:
        left_s = step_s
        while left_s > 0.0:
            angle, flown_m_s = towards_rad + turn_rad, max(0.0, speed_m_s)
            velocity = [
                flown_m_s * math.cos(angle) * mirrored[0],
                flown_m_s * math.sin(angle) * mirrored[1],
            ]
            until_s = [_time_to_edge(place[i], velocity[i], sides[i]) for i in (0, 1)]
            part_s = min(left_s, *until_s)
            if part_s > 0.0:
                u, v = velocity
                at = mobility.at_height(place)
                yield Segment(at_s, at_s + part_s, at, (u, v, 0.0))
                at_s += part_s
                left_s -= part_s
                place = [place[i] + velocity[i] * part_s for i in (0, 1)]
            for i in (0, 1):
                if until_s[i] <= part_s:
                    place[i] = sides[i][velocity[i] > 0]  # exactly the edge
                    mirrored[i] = -mirrored[i]
        speed_m_s = alpha * speed_m_s + (1 - alpha) * mean_m_s + fresh * rng.gauss(0, sigma_m_s)
        turn_rad = alpha * turn_rad + fresh * rng.gauss(0.0, TURN_RAD)


def _within(value: float, low: float, width: float) -> float:
    return min(max(value, low), low + width)


def _time_to_edge(place: float, velocity: float, sides: tuple[float, float]) -> float:
    if not velocity:
        return math.inf
    return max(0.0, (sides[velocity > 0] - place) / velocity)
