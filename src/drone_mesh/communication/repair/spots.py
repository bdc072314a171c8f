"""Positions beside a place, for drones that must not land exactly there."""

from __future__ import annotations

import math
from typing import Iterable, Iterator

from drone_mesh.drone.location import Location

BLOCK = 16  # one spot for each of the 256 ids
WITHIN_REACH = 0.9  # our choice, of the range: how far behind a node that moved a drone stays
PITCH = 1.1  # distance of spots in clearances, with a margin for rounding


def beside(place: Location, origin: Location, distance_m: float) -> Location:
    """The point `distance_m` beside `place`, on the side of `origin`."""
    return _at(place, distance_m, _bearing(place, origin))


def own_spot(
    place: Location, node: int, clearance_m: float, occupied: Iterable[Location] = ()
) -> Location:
    """The spot nearest to `place` that belongs to `node` alone and is clear of `occupied`.

    The ground is a lattice of spots that are clear of each other, divided among the ids 0..255 in
    blocks of 16 x 16. So drones that cannot hear each other never land at the same spot.
    """
    pitch_m = PITCH * clearance_m
    block_m = BLOCK * pitch_m
    row, column = divmod(node, BLOCK)
    south = (place.latitude / pitch_m - row) // BLOCK * block_m + row * pitch_m
    west = (place.longitude / pitch_m - column) // BLOCK * block_m + column * pitch_m
    spots = sorted(
        (
            Location(south + i * block_m, west + j * block_m, place.height)
            for i in range(-1, 3)
            for j in range(-1, 3)
        ),
        key=place.distance_m,
    )
    occupied = list(occupied)
    free = (s for s in spots if all(s.distance_m(other) >= clearance_m for other in occupied))
    return next(free, spots[0])


def free_spot(
    place: Location,
    origin: Location,
    clearance_m: float,
    occupied: Iterable[Location],
    skip: int = 0,
) -> Location:
    """The nearest spot beside `place` that is clear of all `occupied` places.

    Spots towards `origin` come first. `skip` skips that many free spots, so that two drones that
    search at the same time can choose different ones.
    """
    occupied = list(occupied)
    for spot in _spots(place, origin, clearance_m):
        if all(spot.distance_m(other) >= clearance_m for other in occupied):
            if skip == 0:
                return spot
            skip -= 1
    raise AssertionError("the spots never end")


def _spots(place: Location, origin: Location, clearance_m: float) -> Iterator[Location]:
    towards = _bearing(place, origin)
    ring = 0
    while True:
        ring += 1
        step = math.radians(60.0 / ring)
        for number in range(6 * ring):
            side = (number + 1) // 2 * (1 if number % 2 else -1)
            yield _at(place, ring * PITCH * clearance_m, towards + side * step)


def _bearing(place: Location, origin: Location) -> float:
    return math.atan2(origin.latitude - place.latitude, origin.longitude - place.longitude)


def _at(place: Location, distance_m: float, bearing: float) -> Location:
    return Location(
        place.latitude + distance_m * math.sin(bearing),
        place.longitude + distance_m * math.cos(bearing),
        place.height,
    )
