"""Positions at or beside a place, for drones that must keep clear of others."""

from __future__ import annotations

import itertools
import math
from typing import Iterable, Iterator, NamedTuple, Sequence

from drone_mesh.communication.repair.options import LostPlace, RepairOptions
from drone_mesh.drone.location import Location

BLOCK = 8  # spots along each side of a block
SMALL_BLOCK = 3  # our choice: of two drones nine out of ten have their own spots in it
FLOORS = 4  # BLOCK * BLOCK * FLOORS spots: one for each of the 256 ids
WITHIN_REACH = 0.9  # our choice, of the range: how far behind a node that moved a drone stays
PITCH = 1.1  # distance of spots in clearances, with a margin for rounding
NEAR = 1.5  # in clearances: a drone so near to a place has taken it
DIRECTIONS = 24  # our choice: of the spots that are compared for the links that they keep


class Landing(NamedTuple):
    """What to consider when a drone chooses a spot."""

    origin: Location  # where it comes from
    links: Sequence[Location] = ()  # places that should stay in range


def own_spot(
    place: Location,
    node: int,
    clearance_m: float,
    occupied: Iterable[Location] = (),
    block: int = BLOCK,
) -> Location:
    """The spot nearest to `place` that belongs to `node` and is clear of `occupied`.

    Space is a lattice of spots that are clear of each other, divided among the ids 0..255 in blocks
    of 8 x 8 x 4. So drones that cannot hear each other never land at the same spot. In smaller
    blocks, which have one floor, spots are nearer, but ids share them: see small_block.
    """
    pitch_m = PITCH * clearance_m
    block_m = block * pitch_m
    floor, on_floor = divmod(node if block == BLOCK else node % block**2, block**2)
    row, column = divmod(on_floor, block)
    south = (place.latitude / pitch_m - row) // block * block_m + row * pitch_m
    west = (place.longitude / pitch_m - column) // block * block_m + column * pitch_m
    height = place.height + floor * math.ceil(clearance_m)
    spots = sorted(
        (
            Location(south + i * block_m, west + j * block_m, height)
            for i in range(-1, 3)
            for j in range(-1, 3)
        ),
        key=place.distance_m,
    )
    occupied = list(occupied)
    free = (s for s in spots if all(s.distance_m(other) >= clearance_m for other in occupied))
    return next(free, spots[0])


def small_block(node: int, others: Iterable[int]) -> int:
    """The smallest block of `own_spot` in which `node` shares its spots with none of `others`."""
    shared = any(node % SMALL_BLOCK**2 == other % SMALL_BLOCK**2 for other in others)
    return BLOCK if shared else SMALL_BLOCK


def free_spot(
    place: Location,
    landing: Landing,
    options: RepairOptions,
    occupied: Iterable[Location],
    skip: int = 0,
) -> Location:
    """The nearest spot to `place`, but not at it, that is clear of all `occupied` places.

    Of the spots at the same distance, the one that keeps most links comes first, then the one
    nearest to the place where the drone comes from. `skip` skips that many free spots, so that two
    drones that search at the same time can choose different ones.
    """
    occupied = list(occupied)
    for spot in _spots(place, landing, options):
        if all(spot.distance_m(other) >= options.clearance_m for other in occupied):
            if skip == 0:
                return spot
            skip -= 1
    raise AssertionError("the spots never end")


def _spots(place: Location, landing: Landing, options: RepairOptions) -> Iterator[Location]:
    pitch_m = PITCH * options.clearance_m
    if options.lost_place in (LostPlace.ABOVE, LostPlace.BELOW):
        step_m = math.ceil(options.clearance_m)  # heights travel in whole metres
        below_m = place.height - step_m
        is_below = options.lost_place is LostPlace.BELOW and below_m >= 0
        yield place._replace(height=below_m if is_below else place.height + step_m)
    towards = _bearing(place, landing.origin)
    if landing.links:
        turns = sorted(range(DIRECTIONS), key=lambda turn: min(turn, DIRECTIONS - turn))
        bearings = [towards + turn * math.tau / DIRECTIONS for turn in turns]
        towards = min(  # the first of equal ones: the nearest to the origin
            bearings, key=lambda b: _loses(place, _at(place, pitch_m, b), landing.links, options)
        )
    for ring in itertools.count(1):
        step = math.radians(60.0 / ring)
        sides = [(n + 1) // 2 * (1 if n % 2 else -1) for n in range(6 * ring)]
        spots = [_at(place, ring * pitch_m, towards + side * step) for side in sides]
        if landing.links:
            spots.sort(key=lambda spot: _loses(place, spot, landing.links, options))
        yield from spots


def _loses(
    place: Location, spot: Location, links: Sequence[Location], options: RepairOptions
) -> tuple[int, float]:
    """How many of these links are too long for a drone at `spot`, and by how much one grows."""
    away_m = [(spot.distance_m(other), place.distance_m(other)) for other in links]
    too_long = sum(metres >= options.range_m for metres, _before in away_m)
    return too_long, round(max(metres - before for metres, before in away_m), 1)


def _bearing(place: Location, origin: Location) -> float:
    return math.atan2(origin.latitude - place.latitude, origin.longitude - place.longitude)


def _at(place: Location, distance_m: float, bearing: float) -> Location:
    return Location(
        place.latitude + distance_m * math.sin(bearing),
        place.longitude + distance_m * math.cos(bearing),
        place.height,
    )
