"""Reference point group mobility: clusters that move together, each drone wandering within."""

from __future__ import annotations

import math
import random
from typing import Iterator

from drone_mesh.drone.flight_path import Vector
from drone_mesh.mobility.area import Area
from drone_mesh.mobility.random_waypoint import random_waypoint
from drone_mesh.mobility.settings import Mobility
from drone_mesh.mobility.track import Legs, Track, legs_between, rest

WANDERING = 0.5  # mean speed within the group, as a share of the group's


def reference_point(mobility: Mobility, area: Area, rng: random.Random) -> Legs:
    """The middle of one group, on random waypoints that keep the whole group in the area.

    A group that does not fit into the area stays around its middle.
    """
    inside = area.without_border(mobility.radius_m)
    if not inside.diagonal_m:
        return Legs([rest(0.0, mobility.at_height(inside[:2]))])
    return random_waypoint(mobility, inside, rng)


def wandering(mobility: Mobility, rng: random.Random) -> Track:
    """A drone's place relative to the middle of its group (Hong, Gerla, Pei, Chiang 1999).

    At regular times the place is uniform in the circle of the group; in between it moves straight.
    """
    return Legs(legs_between(_knots(mobility, rng)))


def wander_s(mobility: Mobility) -> float:
    """Time between two uniform places; their mean distance is 128 r / 45 pi."""
    way_m = 128 * mobility.radius_m / (45 * math.pi)
    return way_m / (WANDERING * mobility.mean_speed_m_s)


def _knots(mobility: Mobility, rng: random.Random) -> Iterator[tuple[float, Vector]]:
    period_s = wander_s(mobility)
    at_s = -rng.random() * period_s
    while True:
        away_m = mobility.radius_m * math.sqrt(rng.random())
        angle = 2 * math.pi * rng.random()
        yield at_s, (away_m * math.cos(angle), away_m * math.sin(angle), 0.0)
        at_s += period_s
