"""The tracks of a fleet, by the name of the model that moves it."""

from __future__ import annotations

import math
import random
from typing import Callable, Collection, Dict, Iterator, Mapping, NamedTuple, Sequence

from drone_mesh.drone.fleet import ids_in_words
from drone_mesh.drone.flight_path import Vector
from drone_mesh.errors import ConfigurationError
from drone_mesh.mobility.settings import Area, Mobility, check, check_area
from drone_mesh.mobility.track import (
    Legs,
    Loop,
    Segment,
    Together,
    Track,
    climbing,
    leg_to,
    legs_between,
    rest,
)

TURN_RAD = 1.0  # Gauss-Markov: standard deviation of the direction around the drone's mean one
WANDERING = 0.5  # mean speed within a group, as a share of the group's
ARC_CORNERS = 16  # of a half circle


class Fleet(NamedTuple):
    """The drones that a model moves, and its numbers."""

    mobility: Mobility
    places: Mapping[int, Vector]  # of the drones that move, at time 0
    area: Area
    seed: int

    def rng(self, of: object) -> random.Random:
        """A random stream for one drone or group, which the draws of others do not shift."""
        return random.Random(f"{self.seed} motion {of}")

    def speed_m_s(self, of: object) -> float:
        """One drone's constant speed."""
        return random.Random(f"{self.seed} speed {of}").uniform(*self.mobility.speed_m_s)


Model = Callable[[Fleet], Dict[int, Track]]


def tracks_of(
    mobility: Mobility,
    places: Mapping[int, Vector],
    gateways: Collection[int],
    area: Area,
    seed: int,
) -> dict[int, Track]:
    """By id: the tracks of the drones that move. `places`: of all drones, at time 0.

    A trace moves the drones that it names, gateways included. The same seed gives the same motion,
    whatever else is random. Raises ConfigurationError.
    """
    if mobility.kind not in KINDS:
        known = ", ".join(KINDS)
        raise ConfigurationError(f"unknown mobility {mobility.kind}: use one of {known}")
    check(mobility)
    check_area(mobility, area)
    chosen = _movers(mobility, places, gateways, seed)
    return KINDS[mobility.kind](Fleet(mobility, {n: places[n] for n in chosen}, area, seed))


def _movers(
    mobility: Mobility, places: Mapping[int, Vector], gateways: Collection[int], seed: int
) -> list[int]:
    if mobility.kind == "trace":  # the file says who moves
        unknown = sorted(mobility.knots.keys() - places.keys())
        if unknown:
            ids = ids_in_words(places) or "none"
            raise ConfigurationError(f"the trace names drone {unknown[0]}; the drones are {ids}")
        return sorted(mobility.knots)
    movable = [node for node in sorted(places) if mobility.gateways or node not in gateways]
    count = round(mobility.share * len(movable))
    return sorted(random.Random(f"{seed} movers").sample(movable, count))


# Random waypoints ------------------------------------------------------------------------------


def _random_waypoint(fleet: Fleet) -> dict[int, Track]:
    mobility, area = fleet.mobility, fleet.area
    return {
        node: _waypoints(mobility, area, fleet.rng(node), None if mobility.steady else place)
        for node, place in fleet.places.items()
    }


def _waypoints(
    mobility: Mobility, area: Area, rng: random.Random, start: Vector | None = None
) -> Legs:
    """A drone that flies straight to a random point, pauses, and so on.

    In the steady state from time 0 on, or from a place `start` on: without the steady state,
    places, speeds and the number of neighbours drift for minutes. Navidi, Camp: Stationary
    distributions for the random waypoint mobility model, IEEE TMC 2004.
    """
    legs = _straight_legs(mobility, area, rng, start)
    if mobility.climbs:
        return Legs(part for leg in legs for part in climbing(leg, mobility.cruise_height_m))
    return Legs(legs)


def _straight_legs(
    mobility: Mobility, area: Area, rng: random.Random, start: Vector | None
) -> Iterator[Segment]:
    pauses = True
    if start is not None:
        leg, pauses = rest(0.0, start, 0.0), False
    elif rng.random() < _share_at_rest(mobility, area):
        at = area.point(rng, mobility.height_m)
        leg, pauses = rest(0.0, at, rng.random() * mobility.pause_s), False
    else:
        leg = _first_flight(mobility, area, rng)
    while True:
        yield leg
        if pauses and mobility.pause_s:
            leg = rest(leg.end_s, leg.end, leg.end_s + mobility.pause_s)
            yield leg
        to, speed_m_s = area.point(rng, mobility.height_m), rng.uniform(*mobility.speed_m_s)
        flown_s = math.dist(leg.end, to) / speed_m_s
        leg, pauses = leg_to(leg.end_s, leg.end_s + flown_s, leg.end, to), True


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


# Gauss-Markov: speed and direction change gradually, with a memory -----------------------------


def _gauss_markov(fleet: Fleet) -> dict[int, Track]:
    return {
        node: Legs(_turning_legs(fleet.mobility, fleet.area, place, fleet.rng(node)))
        for node, place in fleet.places.items()
    }


def _turning_legs(
    mobility: Mobility, area: Area, start: Vector, rng: random.Random
) -> Iterator[Segment]:
    """A drone that starts at `start`, or where the area is nearest to it (Liang, Haas 1999).

    The speed is normal around the middle of the range, with 95 % of it within the range, and never
    negative. At the edge of the area the drone is reflected, and its mean direction with it.
    """
    low, high = mobility.speed_m_s
    mean_m_s, sigma_m_s = mobility.mean_speed_m_s, (high - low) / 4
    alpha, step_s = mobility.alpha, mobility.update_s
    fresh = math.sqrt(1 - alpha**2)
    towards_rad = rng.uniform(-math.pi, math.pi)
    mirrored = [1.0, 1.0]  # x and y: -1 after an odd number of reflections
    speed_m_s, turn_rad = rng.gauss(mean_m_s, sigma_m_s), rng.gauss(0.0, TURN_RAD)
    at_s = 0.0
    sides = ((area.x, area.x + area.width_m), (area.y, area.y + area.depth_m))
    place = [min(max(value, low), high) for value, (low, high) in zip(start, sides)]
    while True:
        left_s = step_s
        while left_s > 0.0:
            angle, flown_m_s = towards_rad + turn_rad, max(0.0, speed_m_s)
            u = flown_m_s * math.cos(angle) * mirrored[0]
            v = flown_m_s * math.sin(angle) * mirrored[1]
            until_s = list(map(_time_to_edge, place, (u, v), sides))
            part_s = min(left_s, *until_s)
            if part_s > 0.0:
                yield Segment(at_s, at_s + part_s, mobility.at_height(place), (u, v, 0.0))
                at_s += part_s
                left_s -= part_s
                place = [place[0] + u * part_s, place[1] + v * part_s]
            for i, speed in enumerate((u, v)):
                if until_s[i] <= part_s:
                    place[i] = sides[i][speed > 0]  # exactly the edge
                    mirrored[i] = -mirrored[i]
        speed_m_s = alpha * speed_m_s + (1 - alpha) * mean_m_s + fresh * rng.gauss(0, sigma_m_s)
        turn_rad = alpha * turn_rad + fresh * rng.gauss(0.0, TURN_RAD)


def _time_to_edge(place: float, velocity: float, sides: tuple[float, float]) -> float:
    if not velocity:
        return math.inf
    return max(0.0, (sides[velocity > 0] - place) / velocity)


# Groups: reference point mobility, each drone wanders within its group -------------------------


def _group(fleet: Fleet) -> dict[int, Track]:
    mobility, count = fleet.mobility, fleet.mobility.groups
    middles = [reference_point(mobility, fleet.area, fleet.rng(f"group {g}")) for g in range(count)]
    return {
        node: Together(middles[index % count], wandering(mobility, fleet.rng(node)))
        for index, node in enumerate(fleet.places)
    }


def reference_point(mobility: Mobility, area: Area, rng: random.Random) -> Legs:
    """The middle of one group, on random waypoints that keep the whole group in the area.

    A group that does not fit into the area stays around its middle.
    """
    inside = area.without_border(mobility.radius_m)
    if not inside.diagonal_m:
        return Legs([rest(0.0, mobility.at_height(inside[:2]))])
    return _waypoints(mobility, inside, rng)


def wandering(mobility: Mobility, rng: random.Random) -> Track:
    """A drone's place relative to the middle of its group (Hong, Gerla, Pei, Chiang 1999).

    At regular times the place is uniform in the circle of the group; in between it moves straight.
    """

    def knots() -> Iterator[tuple[float, Vector]]:
        period_s = wander_s(mobility)
        at_s = -rng.random() * period_s
        while True:
            away_m = mobility.radius_m * math.sqrt(rng.random())
            angle = 2 * math.pi * rng.random()
            yield at_s, (away_m * math.cos(angle), away_m * math.sin(angle), 0.0)
            at_s += period_s

    return Legs(legs_between(knots()))


def wander_s(mobility: Mobility) -> float:
    """Time between two uniform places; their mean distance is 128 r / 45 pi."""
    way_m = 128 * mobility.radius_m / (45 * math.pi)
    return way_m / (WANDERING * mobility.mean_speed_m_s)


# Fixed lines -----------------------------------------------------------------------------------


def _patrol(fleet: Fleet) -> dict[int, Track]:
    """All drones on one line, evenly spaced at the start."""
    mobility = fleet.mobility
    corners: Sequence[Vector] = [mobility.at_height(point) for point in mobility.waypoints]
    corners = corners or _lanes(mobility, fleet.area)
    length_m = Loop(corners, 1.0).length_m
    shift = fleet.rng("patrol").random()
    return {
        node: Loop(corners, fleet.speed_m_s(node), length_m * (index + shift) / len(fleet.places))
        for index, node in enumerate(fleet.places)
    }


def _lanes(mobility: Mobility, area: Area) -> list[Vector]:
    """The corners of lanes to and fro over the area; the last joins the first along the edge."""
    corners = []
    for lane in range(mobility.lanes):
        y = area.y + area.depth_m * (lane + 0.5) / mobility.lanes
        ends = [area.x, area.x + area.width_m]
        for x in ends if lane % 2 == 0 else reversed(ends):
            corners.append(mobility.at_height((x, y)))
    return corners


def _around_its_place(
    figure: Callable[[Mobility, Vector], list[Vector]], fleet: Fleet
) -> dict[int, Track]:
    tracks: dict[int, Track] = {}
    for node, place in fleet.places.items():
        corners = figure(fleet.mobility, place)
        ahead_m = fleet.rng(node).random() * Loop(corners, 1.0).length_m
        tracks[node] = Loop(corners, fleet.speed_m_s(node), ahead_m)
    return tracks


def _oval(mobility: Mobility, middle: Vector) -> list[Vector]:
    """A racetrack: two straights of two radii each, and two half circles."""
    r, (x, y, _z) = mobility.radius_m, middle
    right = [(x + r + r * math.sin(a), y - r * math.cos(a)) for a in _half_circle()]
    left = [(x - r - r * math.sin(a), y + r * math.cos(a)) for a in _half_circle()]
    return [mobility.at_height(corner) for corner in right + left]


def _eight(mobility: Mobility, middle: Vector) -> list[Vector]:
    """Two circles that touch in the middle, one flown to the left, the other to the right."""
    r, (x, y, _z) = mobility.radius_m, middle
    whole = _half_circle() + [math.pi + a for a in _half_circle()[1:-1]]
    right = [(x + r - r * math.cos(a), y + r * math.sin(a)) for a in whole]
    left = [(x - r + r * math.cos(a), y + r * math.sin(a)) for a in whole]
    return [mobility.at_height(corner) for corner in right + left]


def _half_circle() -> list[float]:
    return [math.pi * part / ARC_CORNERS for part in range(ARC_CORNERS + 1)]


def _trace(fleet: Fleet) -> dict[int, Track]:
    """Before the first time of a drone, it is at its first place."""
    tracks: dict[int, Track] = {}
    for node in fleet.places:
        knots = [(t, (x, y, z)) for t, x, y, z in fleet.mobility.knots[node]]
        tracks[node] = Legs(legs_between([(min(-1.0, knots[0][0] - 1.0), knots[0][1]), *knots]))
    return tracks


KINDS: dict[str, Model] = {
    "none": lambda _fleet: {},
    "random_waypoint": _random_waypoint,
    "gauss_markov": _gauss_markov,
    "group": _group,
    "patrol": _patrol,
    "oval": lambda fleet: _around_its_place(_oval, fleet),
    "eight": lambda fleet: _around_its_place(_eight, fleet),
    "trace": _trace,
}
