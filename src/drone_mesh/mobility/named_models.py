"""The tracks of a fleet, by the name of the model."""

from __future__ import annotations

import random
from typing import Callable, Collection, Dict, Mapping, NamedTuple, Sequence

from drone_mesh.drone.fleet import ids_in_words
from drone_mesh.drone.flight_path import Vector
from drone_mesh.errors import ConfigurationError
from drone_mesh.mobility.area import Area
from drone_mesh.mobility.gauss_markov import gauss_markov
from drone_mesh.mobility.group import reference_point, wandering
from drone_mesh.mobility.patrol import eight, lanes, oval
from drone_mesh.mobility.random_waypoint import random_waypoint
from drone_mesh.mobility.settings import Mobility, check, check_area
from drone_mesh.mobility.track import Legs, Loop, Together, Track, legs_between


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


def _none(_fleet: Fleet) -> dict[int, Track]:
    return {}


def _random_waypoint(fleet: Fleet) -> dict[int, Track]:
    mobility, area = fleet.mobility, fleet.area
    return {
        node: random_waypoint(mobility, area, fleet.rng(node), None if mobility.steady else place)
        for node, place in fleet.places.items()
    }


def _gauss_markov(fleet: Fleet) -> dict[int, Track]:
    return {
        node: gauss_markov(fleet.mobility, fleet.area, place, fleet.rng(node))
        for node, place in fleet.places.items()
    }


def _group(fleet: Fleet) -> dict[int, Track]:
    mobility, count = fleet.mobility, fleet.mobility.groups
    middles = [reference_point(mobility, fleet.area, fleet.rng(f"group {g}")) for g in range(count)]
    return {
        node: Together(middles[index % count], wandering(mobility, fleet.rng(node)))
        for index, node in enumerate(fleet.places)
    }


def _patrol(fleet: Fleet) -> dict[int, Track]:
    """All drones on one line, evenly spaced at the start."""
    mobility = fleet.mobility
    corners: Sequence[Vector] = [mobility.at_height(point) for point in mobility.waypoints]
    corners = corners or lanes(mobility, fleet.area)
    length_m = Loop(corners, 1.0).length_m
    shift = fleet.rng("patrol").random()
    return {
        node: Loop(corners, fleet.speed_m_s(node), length_m * (index + shift) / len(fleet.places))
        for index, node in enumerate(fleet.places)
    }


def _around_its_place(
    figure: Callable[[Mobility, Vector], list[Vector]], fleet: Fleet
) -> dict[int, Track]:
    tracks: dict[int, Track] = {}
    for node, place in fleet.places.items():
        corners = figure(fleet.mobility, place)
        ahead_m = fleet.rng(node).random() * Loop(corners, 1.0).length_m
        tracks[node] = Loop(corners, fleet.speed_m_s(node), ahead_m)
    return tracks


def _trace(fleet: Fleet) -> dict[int, Track]:
    """Before the first time of a drone, it is at its first place."""
    tracks: dict[int, Track] = {}
    for node in fleet.places:
        knots = [(t, (x, y, z)) for t, x, y, z in fleet.mobility.knots[node]]
        tracks[node] = Legs(legs_between([(min(-1.0, knots[0][0] - 1.0), knots[0][1]), *knots]))
    return tracks


KINDS: dict[str, Model] = {
    "none": _none,
    "random_waypoint": _random_waypoint,
    "gauss_markov": _gauss_markov,
    "group": _group,
    "patrol": _patrol,
    "oval": lambda fleet: _around_its_place(oval, fleet),
    "eight": lambda fleet: _around_its_place(eight, fleet),
    "trace": _trace,
}


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
