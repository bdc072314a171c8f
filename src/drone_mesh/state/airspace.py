"""Airspace: the space that drones take, and whether another flight fits in."""

from __future__ import annotations

from typing import Mapping, Sequence

import numpy as np

from drone_mesh.drone.flight_path import FlightPath
from drone_mesh.drone.location import Location
from drone_mesh.state.separation import nearest_m, segments, ways_of

APART_M = 1.0  # least distance between two drones on the way
SWAY_M = 0.5  # our choice: how far physics may move a drone from its path
ONE_PLACE_M = 0.2  # the size of a drone: places nearer than that are one, and not for two drones
_TOUCH_M = 1e-3  # rounding of positions


class Airspace:
    """Who flies, or is about to, and who rests. Paths count whole, whenever they are flown."""

    def __init__(self, sway_m: float, goals: Mapping[int, Location]) -> None:
        """`goals` of all drones of the formation, those at rest included."""
        self._apart_m = APART_M + sway_m
        self._goals = {drone: np.asarray(goal.to_vector()) for drone, goal in goals.items()}
        self._ways = np.empty((0, 2, 3))  # segments of all flights
        self._ends = np.empty((0, 2, 3))  # where the flight of each segment begins and ends
        self._places = np.empty((256, 3))  # of resting drones, by id
        self._rests: np.ndarray = np.zeros(256, dtype=bool)

    def add_resting(self, drone: int, place: Sequence[float]) -> None:
        """This drone rests there."""
        self._places[drone] = place
        self._rests[drone] = True

    def add_flying(self, corners: Sequence[Sequence[float]]) -> None:
        """A drone flies along these corners: its place now, and what is left of its path."""
        self._add(segments(corners), corners[0], corners[-1])

    def set_out(self, drone: int, path: FlightPath) -> None:
        """This drone leaves its place, or is about to."""
        self._rests[drone] = False
        self._add(ways_of(path), path.start, path.goal)

    def _add(self, ways: np.ndarray, start: Sequence[float], end: Sequence[float]) -> None:
        ends = np.broadcast_to(np.asarray([start, end], dtype=float), ways.shape)
        self._ways = np.concatenate([self._ways, ways])
        self._ends = np.concatenate([self._ends, ends])

    def meets_flight(self, path: FlightPath) -> bool:
        """Whether this flight comes too near to one in the air.

        Drones that begin or end near each other may be that near on the way, too.
        """
        if not len(self._ways):
            return False
        starts_m, ends_m = (
            _away_m(self._ends[:, end], point) for end, point in enumerate((path.start, path.goal))
        )
        ends_m = np.where(ends_m < ONE_PLACE_M, APART_M, ends_m)
        allowed_m = np.minimum(self._apart_m, np.minimum(starts_m, ends_m)) - _TOUCH_M
        return bool((nearest_m(ways_of(path), self._ways) < allowed_m).any())

    def in_the_way(self, drone: int, path: FlightPath) -> list[int]:
        """The resting drones to which this flight would come too near.

        A place of a formation may be near another one of it, and 1 m from any other drone.
        """
        self._rests[drone], rested = False, self._rests[drone]
        others = np.flatnonzero(self._rests)
        self._rests[drone] = rested
        places = self._places[others]
        ends_m = np.maximum(_away_m(places, path.goal), APART_M)
        for index, other in enumerate(others):
            goal = self._goals.get(int(other))
            if goal is not None and np.array_equal(goal.round(2), places[index].round(2)):
                away_m = _away_m(places[index], path.goal)
                ends_m[index] = away_m if away_m >= ONE_PLACE_M else APART_M
        starts_m = _away_m(places, path.start)
        allowed_m = np.minimum(self._apart_m, np.minimum(starts_m, ends_m)) - _TOUCH_M
        near_m = nearest_m(ways_of(path), np.stack([places, places], axis=1))
        return [int(other) for other in others[near_m < allowed_m]]


def _away_m(places: np.ndarray, point: Sequence[float]) -> np.ndarray:
    away = places - np.asarray(point, dtype=float)
    length: np.ndarray = np.sqrt((away * away).sum(axis=-1))
    return length
