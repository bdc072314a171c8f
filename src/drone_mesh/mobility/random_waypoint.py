"""Random waypoint: straight to a random point, a pause, and so on."""

from __future__ import annotations

import math
import random
from typing import Iterator

from drone_mesh.drone.flight_path import Vector
from drone_mesh.mobility.area import Area
from drone_mesh.mobility.settings import Mobility
from drone_mesh.mobility.track import Legs, Segment, climbing, leg_to, rest


def random_waypoint(
    mobility: Mobility, area: Area, rng: random.Random, start: Vector | None = None
) -> Legs:
    """A drone on random waypoints, in the steady state from time 0 on; or from a place `start` on.

    Without the steady state, places, speeds and the number of neighbours drift for minutes. Navidi,
    Camp: Stationary distributions for the random waypoint mobility model, IEEE TMC 2004.
    """
    legs = _legs(mobility, area, rng, start)
    if mobility.climbs:
        return Legs(part for leg in legs for part in climbing(leg, mobility.cruise_height_m))
    return Legs(legs)


def _legs(
    mobility: Mobility, area: Area, rng: random.Random, start: Vector | None
) -> Iterator[Segment]:
    if start is not None:
        leg = rest(0.0, start, 0.0)
        yield leg
    elif rng.random() < _share_at_rest(mobility, area):
        leg = rest(0.0, area.point(rng, mobility.height_m), rng.random() * mobility.pause_s)
        yield leg
    else:
        leg = _first_flight(mobility, area, rng)
        yield leg
        if mobility.pause_s:
            leg = rest(leg.end_s, leg.end, leg.end_s + mobility.pause_s)
            yield leg
    while True:
        to, speed_m_s = area.point(rng, mobility.height_m), rng.uniform(*mobility.speed_m_s)
        flown_s = math.dist(leg.end, to) / speed_m_s
        leg = leg_to(leg.end_s, leg.end_s + flown_s, leg.end, to)
        yield leg
        if mobility.pause_s:
            leg = rest(leg.end_s, to, leg.end_s + mobility.pause_s)
            yield leg


def _share_at_rest(mobility: Mobility, area: Area) -> float:
    low, high = mobility.speed_m_s
    slowness = 1 / low if low == high else math.log(high / low) / (high - low)  # mean s/m
    flown_s = area.mean_distance_m * slowness
    return mobility.pause_s / (mobility.pause_s + flown_s)


def _first_flight(mobility: Mobility, area: Area, rng: random.Random) -> Segment:
    """A flight that is under way at time 0: longer and slower ones are more likely."""
    low, high = mobility.speed_m_s
    speed_m_s = low * (high / low) ** rng.random()  # density 1 / v
    while True:
        one, other = (area.point(rng, mobility.height_m) for _ in range(2))
        length_m = math.dist(one, other)
        if rng.random() * area.diagonal_m < length_m:
            break
    flown_s = length_m / speed_m_s
    passed_s = rng.random() * flown_s
    return leg_to(-passed_s, flown_s - passed_s, one, other)
