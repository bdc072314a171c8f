"""Where a repair may end: at or beside a place, on the ground, and clear of other drones.

docs/repair.md, "Places of silent drones".
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from typing import Callable, Iterable, Iterator, NamedTuple, Sequence

from drone_mesh.communication.control.places import KnownPlaces
from drone_mesh.communication.neighbours import Neighbours
from drone_mesh.communication.repair.options import LostPlace, RepairOptions
from drone_mesh.communication.timing import Deadlines
from drone_mesh.drone.flight_path import FlightPath, Vector
from drone_mesh.drone.goal import check_goal
from drone_mesh.drone.location import Location
from drone_mesh.errors import GoalRefused

LOWEST_M = -10.0  # a place further below the origin is a mistake


def above_ground(place: Location) -> Location:
    """`place`, not lower than the origin: altitudes err by metres, and a field may slope."""
    return place if place.height >= 0 else place._replace(height=0)


def at_whole_metres(place: Location) -> Location:
    """Where a repair ends instead of at `place`.

    A LOCATION has whole metres of height only, and a beacon tenths: from elsewhere others would not
    know how near this drone is.
    """
    return above_ground(place._replace(height=round(place.height)))


def may_be_flown_to(place: Location) -> bool:
    """Whether a drone may fly there: a LOCATION may contain any numbers."""
    if place.height < LOWEST_M:
        return False
    try:
        check_goal(*at_whole_metres(place))
    except GoalRefused:
        return False
    return True


Allows = Callable[[Location], bool]
"""Whether the fences allow a place."""


def everywhere(_place: Location) -> bool:
    """There are no fences."""
    return True


BLOCK = 8  # spots along each side of a block
BLOCKS = (2, 4, BLOCK)  # each divides the next one
WITHIN_REACH = 0.9  # of the range: how far behind a node that moved a drone stays
PITCH = 1.1  # distance of spots in clearances, with a margin for rounding
ROUNDING_M = 0.09  # a place in a beacon has tenths of a metre, on three axes
NEAR = 1.5  # in clearances: a drone so near to a place has taken it
DIRECTIONS = 24  # that are compared for spots, and for ways round others


class Landing(NamedTuple):
    """What to consider when a drone chooses a spot."""

    origin: Location  # where it comes from
    links: Sequence[Location] = ()  # places that should stay in range


def own_spot(
    place: Location,
    node: int,
    options: RepairOptions,
    occupied: Sequence[Location] = (),
    allows: Allows = everywhere,
    rivals: Iterable[int] = (),
) -> Location:
    """The allowed spot nearest to `place` that belongs to `node` alone and is clear of `occupied`.

    Space is a lattice of spots that are clear of each other, divided among the ids 0..255 in blocks
    of 8 x 8 x 4. So drones that cannot hear each other never land at the same spot. If a fence
    leaves a drone none in reach of the place, where it would find nobody, it takes one of a smaller
    block that none of `rivals` takes, if they know of `node`, too.
    """
    return _own_spot(place, node, rivals, BLOCK, Landing(place), options, occupied, allows)


def spot_beside_rivals(
    place: Location,
    node: int,
    rivals: Iterable[int],
    landing: Landing,
    options: RepairOptions,
    occupied: Sequence[Location],
    allows: Allows = everywhere,
) -> Location:
    """A spot near `place` that belongs to `node` and to none of `rivals`, and keeps most links.

    As `own_spot`, in the smallest blocks of 2 x 2, 4 x 4 or 8 x 8 x 4 that separate their ids. The
    spots of an id in large blocks are among its spots in smaller ones, so drones that choose
    different blocks have different spots, too.
    """
    rivals = list(rivals)
    others = [_class_of(other, block) for block in BLOCKS for other in rivals]
    block = next((b for b in BLOCKS if _class_of(node, b) not in others), BLOCK)
    return _own_spot(place, node, rivals, block, landing, options, occupied, allows)


def _own_spot(
    place: Location,
    node: int,
    rivals: Iterable[int],
    block: int,
    landing: Landing,
    options: RepairOptions,
    occupied: Sequence[Location],
    allows: Allows,
) -> Location:
    spots = sorted(
        _own_spots(place, node, options.clearance_m, block),
        key=lambda spot: (_too_long(spot, landing.links, options), place.distance_m(spot)),
    )
    best = _first_clear(spots, options.clearance_m, occupied, allows)
    reach_m = WITHIN_REACH * options.range_m
    near = [spot for spot in spots if place.distance_m(spot) <= reach_m]
    if (best in near and allows(best)) or all(map(allows, near)):
        return best
    for smaller in (size for size in reversed(BLOCKS) if size < block):
        shared = _shared_spots(place, node, rivals, options.clearance_m, smaller)
        near = [spot for spot in shared if place.distance_m(spot) <= reach_m and allows(spot)]
        for spot in near:
            if _is_clear_of(spot, occupied, options.clearance_m):
                return spot
    return best


def _shared_spots(
    place: Location, node: int, rivals: Iterable[int], clearance_m: float, block: int
) -> list[Location]:
    """The spots of these blocks that none of `rivals` takes, the nearest first.

    Those of larger blocks belong to one of the drones alone; the others are dealt out in turn.
    """
    group = _class_of(node, block)
    sharers = sorted({node, *(r for r in rivals if _class_of(r, block) == group)})
    kept = [s for one in sharers for s in _own_spots(place, one, clearance_m, 2 * block)]
    spots = [
        spot
        for spot in _own_spots(place, node, clearance_m, block)
        if _is_clear_of(spot, kept, clearance_m)
    ]
    return sorted(spots, key=place.distance_m)[sharers.index(node) :: len(sharers)]


def _class_of(node: int, block: int) -> tuple[int, ...]:
    """The class of spots that belongs to `node`, of blocks with `block` spots along each side."""
    floor, on_floor = divmod(node, BLOCK * BLOCK)
    row, column = divmod(on_floor, BLOCK)
    return block, row % block, column % block, floor if block == BLOCK else 0


def _own_spots(place: Location, node: int, clearance_m: float, block: int) -> list[Location]:
    pitch_m = PITCH * clearance_m
    block_m = block * pitch_m
    _block, row, column, floor = _class_of(node, block)
    south = (place.latitude / pitch_m - row) // block * block_m + row * pitch_m
    west = (place.longitude / pitch_m - column) // block * block_m + column * pitch_m
    height = place.height + floor * math.ceil(clearance_m)
    return [
        Location(south + i * block_m, west + j * block_m, height)
        for i in range(-1, 3)
        for j in range(-1, 3)
    ]


def _first_clear(
    spots: Sequence[Location], clearance_m: float, occupied: Sequence[Location], allows: Allows
) -> Location:
    free = (spot for spot in spots if allows(spot) and _is_clear_of(spot, occupied, clearance_m))
    return next(free, spots[0])


def _is_clear_of(spot: Location, others: Iterable[Location], clearance_m: float) -> bool:
    """Whether a drone may rest there; one above the other do so in whole metres."""
    return all(
        spot.distance_m(other) >= clearance_m + ROUNDING_M
        or abs(spot.height - other.height) >= clearance_m
        for other in others
    )


def free_spot(
    place: Location,
    landing: Landing,
    options: RepairOptions,
    occupied: Iterable[Location],
    skip: int = 0,
    allows: Allows = everywhere,
) -> Location:
    """The nearest spot to `place`, but not at it, that is clear of all `occupied` places.

    Of the spots at the same distance, the one that keeps most links comes first, then the one
    nearest to the place where the drone comes from. `skip` skips that many free spots, so that two
    drones that search at the same time can choose different ones. If the fences allow none within
    range of the place, the place itself, which the drone is then refused.
    """
    occupied = list(occupied)
    for spot in _spots(place, landing, options):
        if not allows(spot):
            if spot.distance_m(place) > options.range_m:
                return place
        elif _is_clear_of(spot, occupied, options.clearance_m):
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
    longer_m = round(max(metres - before for metres, before in away_m), 1)
    return _too_long(spot, links, options), longer_m


def _too_long(spot: Location, links: Sequence[Location], options: RepairOptions) -> int:
    return sum(spot.distance_m(other) >= options.range_m for other in links)


def _bearing(place: Location, origin: Location) -> float:
    return math.atan2(origin.latitude - place.latitude, origin.longitude - place.longitude)


def _at(place: Location, distance_m: float, bearing: float) -> Location:
    return Location(
        place.latitude + distance_m * math.sin(bearing),
        place.longitude + distance_m * math.cos(bearing),
        place.height,
    )


TOUCH_M = 1e-3  # of sums
ASIDE = 3.0  # clearances: half of that is how high it climbs, over drones on the ground
FRESH_S = 5.0  # with EXACT, a drone that was silent for longer takes no place


@dataclass(eq=False)
class TakenPlaces:
    """The places of other drones, as one node knows them, and the spots that are clear of them."""

    _node_id: int
    _deadlines: Deadlines
    _neighbours: Neighbours
    _places: KnownPlaces
    _options: RepairOptions
    allows: Allows = everywhere
    plan: Callable[[Vector, Vector, float], FlightPath | None] = FlightPath  # IDroneEngine.plan

    def all(self) -> list[Location]:
        """Where each other node was last heard, and the gateway's place."""
        now_s, me = self._deadlines.now_s, self._node_id
        gateway = self._places.gateway  # it may be there, although it is off now
        kept_free = [] if gateway is None else [above_ground(gateway)]
        exact = self._options.lost_place is LostPlace.EXACT
        return kept_free + [
            above_ground(heard.place)
            for node, heard in self._neighbours.taken()
            if node != me and not (exact and now_s - heard.heard_s > FRESH_S)
        ]

    def is_free(self, spot: Location, tried: Sequence[Location] = ()) -> bool:
        """Whether it is allowed, and clear of other drones and of spots that were tried in vain."""
        clearance_m = self._options.clearance_m + ROUNDING_M
        return self.allows(spot) and all(
            spot.distance_m(other) >= clearance_m for other in [*self.all(), *tried]
        )

    def is_clear(self, way: FlightPath, of: Sequence[Location] = ()) -> bool:
        """Whether the rest of this way is clear of these places, or of all.

        Where it begins or ends nearer to one than the clearance, it comes no nearer on the way.
        """
        now_s, clearance_m = self._deadlines.now_s, self._options.clearance_m + ROUNDING_M
        here, goal = (Location.from_vector(end) for end in (way.position_at(now_s), way.goal))
        return all(
            way.passes_m(place.to_vector(), now_s)
            > min(clearance_m, here.distance_m(place), goal.distance_m(place)) - TOUCH_M
            for place in of or self.all()
        )

    def way(self, start: Location, end: Location) -> FlightPath:
        """How the drone flies if it sets out now; straight if it would not."""
        ends_s = start.to_vector(), end.to_vector(), self._deadlines.now_s
        return self.plan(*ends_s) or FlightPath(*ends_s)

    def aside(self, here: Location, end: Location) -> Location:
        """A free place from where no other is in the way to `end`, nor on the way there, or `end`.

        With small turns first, to both sides.
        """
        away_m = max(here.distance_m(end), ASIDE * self._options.clearance_m)
        for turn in range(1, DIRECTIONS):
            bearing = _bearing(here, end) + (-1) ** turn * (turn // 2) * math.tau / DIRECTIONS
            spot = _at(here, away_m, bearing)._replace(height=end.height)
            ways = self.way(here, spot), self.way(spot, end)
            if self.is_free(spot) and all(map(self.is_clear, ways)):
                return spot
        return end

    def at_or_beside(
        self, place: Location, landing: Landing, tried: Sequence[Location] = ()
    ) -> Location:
        """`place` if that is free, else the best spot near it; none of those that it `tried`."""
        if self.is_free(place, tried):
            return place
        occupied = [*self.all(), *tried]
        return free_spot(place, landing, self._options, occupied, allows=self.allows)
