"""Fences: areas that drones stay inside or out of, with heights. Pure geometry, in metres.

In plain Python: most areas have few corners, for which numpy would be slower, and a Pi does without
loading it. shapely knows no heights, and would bring GEOS for what is short here: whether a point
is inside, and where a line meets an edge.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Iterable, Iterator, NamedTuple, Sequence, Tuple

from drone_mesh.drone.flight_path import Point, Vector, between
from drone_mesh.errors import ConfigurationError

Ring = Tuple[Point, ...]

OF_AUTOPILOT = "the autopilot's fence"  # how the names of areas begin that an autopilot keeps
CLEAR_M = 0.5  # how far a way round keeps from a fence; as from a box (air/obstacles.py)
CIRCLE_CORNERS = 64  # the polygon for a circle is off by 0.12 % of its radius, to the safe side
CIRCLE_TURNS = 16  # of ways round a circle, which are up to 2 % longer so
MOST_CORNERS = 500  # of one area; the search for a way round tries all of them
_SHORT_M = 1e-6  # a shorter piece of a way is rounding
_ROUNDING = 1e-9  # of shares
_SHARPEST = 1.0 / 3.0  # at a sharper corner, ways round keep 3 * CLEAR_M from its tip


_PART = 16  # edges that are looked at, or left out, together

Box = Tuple[float, float, float, float]  # least and greatest x, least and greatest y
_Part = Tuple[Box, Sequence[Tuple[Point, Point]]]  # edges that follow each other


class Turn(NamedTuple):
    """Where a way round something may turn."""

    at: Point
    corners: tuple[Point, Point, Point] | None = None  # its own between two; None: it may anyhow
    in_bay: bool = False  # other turns of what it is at enclose it: of use only to who is in there

    @property
    def near(self) -> Point:
        """The corner that it is beside."""
        return self.at if self.corners is None else self.corners[1]

    def is_touched_from(self, other: Point) -> bool:
        """Whether a straight way from there passes both corners beside its own on one side.

        A shortest way touches what it goes round: it has no other pieces. From nearer to an edge
        than this turn is, it touches the corner itself.
        """
        if self.corners is None:
            return True
        before, corner, after = self.corners
        return _passes(other, self.at, before, after) or _passes(other, corner, before, after)


def _passes(start: Point, end: Point, one: Point, other: Point) -> bool:
    """Whether both places are on one side of the line from start to end."""
    x, y = end
    dx, dy = x - start[0], y - start[1]
    left, right = dx * (one[1] - y) - dy * (one[0] - x), dx * (other[1] - y) - dy * (other[0] - x)
    slack = _SHORT_M * (abs(dx) + abs(dy))
    return (left <= slack and right <= slack) or (left >= -slack and right >= -slack)


@dataclass(frozen=True)
class Zone:
    """An area between two heights. A point within an odd number of its rings is inside."""

    name: str
    rings: tuple[Ring, ...]
    lowest_m: float = -math.inf
    highest_m: float = math.inf
    turns: tuple[Turn, ...] = ()  # of ways round it; empty: outside each corner
    edges: tuple[tuple[Point, Point], ...] = field(init=False, repr=False, compare=False)
    beside: tuple[Point, ...] = field(init=False, repr=False, compare=False)
    """Points at CLEAR_M from each corner, on either side: first where it is the tip."""
    _parts: tuple[_Part, ...] = field(init=False, repr=False, compare=False)
    _box: Box = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        """Raise ConfigurationError, which does not name the zone, for what is no area."""
        if not self.lowest_m < self.highest_m:
            raise ConfigurationError("its least height is not below its greatest")
        edges: list[tuple[Point, Point]] = []
        beside: list[Point] = []
        turns: list[Turn] = []
        for ring in self.rings:
            # Programs close a ring with its first corner, or do not.
            corners = [p for p, before in zip(ring, (*ring[-1:], *ring)) if p != before]
            if len(corners) < 3:
                raise ConfigurationError(f"{len(corners)} different corners: an area needs 3")
            edges += _closed(corners)
            both = list(_beside(corners))
            beside += both
            turns += _turns(both[::2], corners)
        if len(edges) > MOST_CORNERS:
            raise ConfigurationError(f"{len(edges)} corners: at most {MOST_CORNERS} are allowed")
        object.__setattr__(self, "edges", tuple(edges))
        object.__setattr__(self, "beside", tuple(beside))
        object.__setattr__(self, "_parts", tuple(_parts(edges)))
        object.__setattr__(self, "_box", box_around(start for start, _end in edges))
        object.__setattr__(self, "turns", self.turns or tuple(turns))
        for number, (start, end) in enumerate(edges):
            if any(True for _ in _meetings(start, end, edges[:number], inset=_ROUNDING)):
                raise ConfigurationError("its edges cross: which side is inside is not clear")
        if abs(sum(p[0] * q[1] - p[1] * q[0] for p, q in edges)) < _SHORT_M:
            raise ConfigurationError("its corners are in a line: they enclose nothing")

    @classmethod
    def circle(
        cls,
        name: str,
        center: Point,
        radius_m: float,
        inside: bool,
        heights: tuple[float, float] = (-math.inf, math.inf),
    ) -> Zone:
        """A circle to stay inside of, or out of, as the polygon on that side of it."""
        if not radius_m > 0.0:
            raise ConfigurationError(f"radius {radius_m:g} m: it has to be above 0")
        reach_m = radius_m if inside else radius_m / math.cos(math.pi / CIRCLE_CORNERS)
        turn_m = (reach_m + CLEAR_M) / math.cos(math.pi / CIRCLE_TURNS)
        rings = (_around(center, reach_m, CIRCLE_CORNERS),)
        turns = _around(center, turn_m, CIRCLE_TURNS)
        return cls(name, rings, *heights, turns=tuple(_turns(turns, rings[0])))

    def surrounds(self, place: Vector) -> bool:
        """Whether this place is inside, seen from above."""
        x, y, _z = place
        inside = False
        if not overlap(self._box, (x, x, y, y)):
            return inside
        for (x1, y1), (x2, y2) in self._edges_within(x, math.inf, y, y):
            if (y1 > y) != (y2 > y) and x < x1 + (y - y1) * (x2 - x1) / (y2 - y1):
                inside = not inside
        return inside

    def contains(self, place: Vector) -> bool:
        """Whether this place is inside, at its heights."""
        return self.lowest_m <= place[2] <= self.highest_m and self.surrounds(place)

    def cuts(self, a: Vector, b: Vector) -> Iterator[float]:
        """Where the way from a to b passes its sides, floor or ceiling: shares of that way."""
        (x1, y1, _z1), (x2, y2, _z2) = a, b
        box = min(x1, x2), max(x1, x2), min(y1, y2), max(y1, y2)
        yield from _meetings(a[:2], b[:2], self._edges_within(*box), inset=-_ROUNDING)
        if a[2] != b[2]:
            for height_m in (self.lowest_m, self.highest_m):
                yield (height_m - a[2]) / (b[2] - a[2])

    def _edges_within(
        self, left: float, right: float, low: float, high: float
    ) -> Iterator[tuple[Point, Point]]:
        """Its edges that reach into this rectangle, and others near them."""
        for (x1, x2, y1, y2), edges in self._parts:
            if x1 <= right and left <= x2 and y1 <= high and low <= y2:
                yield from edges

    def may_meet(self, box: Box) -> bool:
        """Whether it may reach into this box; False: it does not."""
        return overlap(self._box, box)

    def nearest(self, place: Vector) -> Iterator[Point]:
        """The points of its edges nearest to a place, moved by CLEAR_M to either side."""
        x, y, _z = place
        for (x1, y1), (x2, y2) in self.edges:
            dx, dy = x2 - x1, y2 - y1
            length_m = math.hypot(dx, dy)
            share = ((x - x1) * dx + (y - y1) * dy) / length_m**2
            share = min(1.0, max(0.0, share))
            for side_m in (CLEAR_M / length_m, -CLEAR_M / length_m):
                yield x1 + share * dx - side_m * dy, y1 + share * dy + side_m * dx


@dataclass(frozen=True)
class Rule:
    """Stay inside any of these zones, or out of all of them."""

    zones: tuple[Zone, ...]
    inside: bool
    _turns: dict[tuple[bool, ...], tuple[Turn, ...]] = field(
        default_factory=dict, init=False, repr=False, compare=False
    )  # by the zones that count at a height

    @property
    def names(self) -> str:
        """The names of its zones."""
        return " or ".join(zone.name for zone in self.zones)

    @property
    def top_m(self) -> float:
        """The height above which flights pass; infinity: none does."""
        return math.inf if self.inside else max(zone.highest_m for zone in self.zones)

    def allows(self, place: Vector) -> bool:
        """Whether a drone may be there."""
        return any(zone.contains(place) for zone in self.zones) is self.inside

    def meets(self, a: Vector, b: Vector) -> bool:
        """Whether the straight way from a to b breaks it anywhere."""
        box = box_around((a[:2], b[:2]))
        near = [zone for zone in self.zones if zone.may_meet(box)]

        def breaks(place: Vector) -> bool:
            return any(zone.contains(place) for zone in near) is not self.inside

        if breaks(between(a, b, 0.5)) and math.dist(a, b) > _SHORT_M:
            return True  # as most ways that do
        return any(breaks(middle) for _share, middle in _pieces(near, a, b))

    def turns(self, height_m: float) -> Sequence[Turn]:
        """Where ways round it may turn, at this height."""
        alone = len(self.zones) == 1
        there = tuple(alone or z.lowest_m <= height_m <= z.highest_m for z in self.zones)
        if there not in self._turns:
            zones = [zone for zone, counts in zip(self.zones, there) if counts]
            self._turns[there] = tuple(_turns_at(zones, self.inside))
        return self._turns[there]

    def why_not(self, place: Vector) -> str:
        """Why a drone may not be there; empty if it may."""
        if self.allows(place):
            return ""
        if not self.inside:
            return f"inside {called(self.names)}, which drones stay out of"
        x, y, height_m = place
        for zone in self.zones:
            if zone.surrounds(place):
                high = height_m > zone.highest_m
                side, end_m = ("above", zone.highest_m) if high else ("below", zone.lowest_m)
                return f"{side} {called(zone.name)}: {height_m:.4g} m, and it ends at {end_m:g} m"
        return f"outside {called(self.names)}"


@dataclass(frozen=True)
class Fence:
    """All rules of a file or of an autopilot; without any, everything is allowed."""

    rules: tuple[Rule, ...] = ()

    def __bool__(self) -> bool:
        return bool(self.rules)

    @classmethod
    def of(cls, inside: Iterable[Zone], outside: Iterable[Zone]) -> Fence:
        """Stay in any of the first and out of all of the second."""
        within = tuple(inside)
        rules = [Rule(within, True)] if within else []
        return cls((*rules, *(Rule((zone,), False) for zone in outside)))

    @property
    def zones(self) -> list[tuple[Zone, bool]]:
        """Each zone, and whether drones stay inside."""
        return [(zone, rule.inside) for rule in self.rules for zone in rule.zones]

    @property
    def names(self) -> str:
        """The names of all zones."""
        return ", ".join(zone.name for zone, _inside in self.zones)

    def raised(self, metres: float) -> Fence:
        """The same for points that are so much above the places that count, as a body's centre.

        A body that is to stay below an area does so as a whole: lower ends stay.
        """
        rules = (
            replace(r, zones=tuple(replace(z, highest_m=z.highest_m + metres) for z in r.zones))
            for r in self.rules
        )
        return Fence(tuple(rules))

    @property
    def ceilings(self) -> list[float]:
        """Heights below which ways pass under a zone or stay in it, highest first."""
        ends = {zone.highest_m if inside else zone.lowest_m for zone, inside in self.zones}
        return sorted((height_m for height_m in ends if math.isfinite(height_m)), reverse=True)

    def why_not(self, place: Vector) -> str:
        """Why a drone may not be there, with the name of the fence; empty if it may."""
        return next(filter(None, (rule.why_not(place) for rule in self.rules)), "")

    def why_not_straight(self, places: Sequence[Vector]) -> str:
        """Why a drone may not fly straight from each of these places to the next; empty: it may."""
        for one, other in zip(places, places[1:] or places):
            for rule in self.rules:
                if rule.meets(one, other):
                    return rule.why_not(other) or f"its way passes {called(rule.names)}"
        return ""

    def outside_share(self, a: Vector, b: Vector) -> float:
        """The share of the straight way from a to b that breaks any rule."""
        pieces = _pieces([zone for zone, _inside in self.zones], a, b)
        return sum(share for share, middle in pieces if self.why_not(middle))

    def nearest_inside(self, place: Vector) -> Vector | None:
        """The nearest place at the same height that keeps all rules; None: there is none."""
        return next(self.places_inside(place), None)

    def places_inside(self, place: Vector) -> Iterator[Vector]:
        """That one, and others beside edges and corners, the nearest first."""
        if not self.why_not(place):  # as most places are, and then few callers want another
            yield place
        found = (point for zone, _inside in self.zones for point in zone.nearest(place))
        corners = (point for zone, _inside in self.zones for point in zone.beside)
        points = sorted({*found, *corners}, key=lambda point: math.dist(point, place[:2]))
        places = ((x, y, place[2]) for x, y in points)
        yield from (one for one in places if not self.why_not(one))


def called(names: str) -> str:
    """These names as a part of a sentence."""
    return names if names.startswith(OF_AUTOPILOT) else f"fence {names}"


def _pieces(zones: Iterable[Zone], a: Vector, b: Vector) -> Iterator[tuple[float, Vector]]:
    """The straight way from a to b between the borders of zones: shares of it, and the middles."""
    cuts = (share for zone in zones for share in zone.cuts(a, b) if 0.0 < share < 1.0)
    length_m = math.dist(a, b)
    shares = [0.0, *(sorted(cuts) if length_m > _SHORT_M else ()), 1.0]
    for start, end in zip(shares, shares[1:]):
        if (end - start) * length_m > _SHORT_M or length_m <= _SHORT_M:
            yield end - start, between(a, b, (start + end) / 2.0)


def _turns_at(zones: Sequence[Zone], inside: bool) -> Iterator[Turn]:
    """Turns at the border of what these zones cover together, on this side of it."""
    if len(zones) == 1:
        turns = [t for t in zones[0].turns if zones[0].surrounds((*t.at, 0.0)) is inside]
        outer = _hull([turn.at for turn in turns])
        yield from (t._replace(in_bay=not (inside or t.at in outer)) for t in turns)
        return
    points = [turn.at for zone in zones for turn in zone.turns if _at_border(turn.near, zones)]
    points = [p for p in points if any(zone.surrounds((*p, 0.0)) for zone in zones)]
    yield from map(Turn, dict.fromkeys((*points, *_passages(zones))))


def _hull(points: Iterable[Point]) -> set[Point]:
    """The corners of the smallest convex area around these points, and points on its edges."""
    found: set[Point] = set()
    ordered = sorted(points)
    for way in (ordered, ordered[::-1]):
        side: list[Point] = []
        for x, y in way:
            while len(side) > 1:
                (x1, y1), (x2, y2) = side[-2:]
                if (x2 - x1) * (y - y1) - (y2 - y1) * (x - x1) >= -_SHORT_M:
                    break
                side.pop()
            side.append((x, y))
        found.update(side)
    return found


def _passages(zones: Sequence[Zone]) -> Iterator[Point]:
    """Points around where two zones overlap or touch, through which ways lead."""
    for zone in zones:
        others = [other for other in zones if other is not zone]
        for a, b in zone.edges:
            met = (
                between((*a, 0.0), (*b, 0.0), s)
                for o in others
                for s in o.cuts((*a, 0.0), (*b, 0.0))
            )
            for x, y, _z in ((*a, 0.0), *met):
                if any(o.may_meet(_clear_of(x, y)) for o in others):
                    yield from _at_border((x, y), zones)


def _clear_of(x: float, y: float) -> Box:
    return x - CLEAR_M, x + CLEAR_M, y - CLEAR_M, y + CLEAR_M


def _at_border(place: Point, zones: Sequence[Zone]) -> list[Point]:
    """Points around a place that are within these zones; none if all are: it is no border."""
    x, y = place
    near = [zone for zone in zones if zone.may_meet(_clear_of(x, y))]
    steps = (-CLEAR_M, 0.0, CLEAR_M)
    around = [(x + dx, y + dy) for dx in steps for dy in steps]
    within = [p for p in around if any(zone.surrounds((*p, 0.0)) for zone in near)]
    return within if len(within) < len(around) else []


def box_around(points: Iterable[Point]) -> Box:
    """The box around points, of which there are some."""
    xs, ys = zip(*points)
    return min(xs), max(xs), min(ys), max(ys)


def overlap(one: Box, other: Box) -> bool:
    """Whether two boxes have a point in common."""
    return one[0] <= other[1] and other[0] <= one[1] and one[2] <= other[3] and other[2] <= one[3]


def _closed(corners: Sequence[Point]) -> list[tuple[Point, Point]]:
    return list(zip(corners, (*corners[1:], corners[0])))


def _parts(edges: Sequence[tuple[Point, Point]]) -> Iterator[_Part]:
    for start in range(0, len(edges), _PART):
        part = edges[start : start + _PART]
        yield box_around(corner for edge in part for corner in edge), part


def _meetings(
    a: Sequence[float], b: Sequence[float], edges: Iterable[tuple[Point, Point]], inset: float
) -> Iterator[float]:
    """Where a..b meets these edges, as shares of a..b; not within `inset` of any of the ends.

    A way through a corner would miss both edges there, as rounded, without an `inset` below 0.
    """
    ax, ay = a
    dx, dy = b[0] - ax, b[1] - ay
    for (x1, y1), (x2, y2) in edges:
        ex, ey = x2 - x1, y2 - y1
        spread = dx * ey - dy * ex
        if spread:  # not parallel
            gx, gy = x1 - ax, y1 - ay
            share = (gx * ey - gy * ex) / spread
            if inset <= (gx * dy - gy * dx) / spread <= 1.0 - inset and inset <= share <= 1 - inset:
                yield share


def _turns(points: Sequence[Point], ring: Sequence[Point]) -> Iterator[Turn]:
    """Turns at these points: one off each corner of this ring, or off every few of them."""
    for number, at in enumerate(points):
        corner = number * len(ring) // len(points)
        yield Turn(at, (ring[corner - 1], ring[corner], ring[(corner + 1) % len(ring)]))


def _around(center: Point, radius_m: float, corners: int) -> Ring:
    turns = (math.tau * n / corners for n in range(corners))
    return tuple(
        (center[0] + radius_m * math.cos(turn), center[1] + radius_m * math.sin(turn))
        for turn in turns
    )


def _beside(corners: Sequence[Point]) -> Iterator[Point]:
    """Each corner, moved by CLEAR_M from both edges there: to where it is the tip, and away."""
    others = zip((corners[-1], *corners), corners, (*corners[1:], corners[0]))
    for (x0, y0), (x, y), (x2, y2) in others:
        before_m, after_m = math.dist((x0, y0), (x, y)), math.dist((x, y), (x2, y2))
        ux, uy = (x - x0) / before_m, (y - y0) / before_m
        vx, vy = (x2 - x) / after_m, (y2 - y) / after_m
        length = math.hypot(ux + vx, uy + vy)  # twice the cosine of half the turn
        nx, ny = (-(uy + vy) / length, (ux + vx) / length) if length > 1e-9 else (ux, uy)
        away_m = CLEAR_M / max(length / 2.0, _SHARPEST)
        if ux * vy - uy * vx > 0.0:  # it turns left: the tip is on the right
            away_m = -away_m
        yield x + away_m * nx, y + away_m * ny
        yield x - away_m * nx, y - away_m * ny
