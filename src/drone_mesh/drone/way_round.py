"""The shortest way round what is in the way of a flight, at one height."""

from __future__ import annotations

import heapq
import math
from typing import Iterator, Protocol, Sequence

from drone_mesh.drone.fence import Fence, Turn, box_around, overlap
from drone_mesh.drone.flight_path import Point, Vector

MOST_MET = 10  # on one path; the search time grows with the cube
MOST_LEGS = 4_000  # that a search tries: an autopilot hears nothing meanwhile
MOST_ENTRIES = 4  # places inside that a drone outside is led to past others
ALL_OUTSIDE = 1.0 - 1e-6  # the share of a leg that is, as rounded


class InTheWay(Protocol):
    """A box, or a rule of a fence."""

    def meets(self, a: Vector, b: Vector) -> bool:
        """Whether it is in the way from a to b."""

    def turns(self, height_m: float) -> Sequence[Turn]:
        """Where ways round it may turn."""


def way_across(
    fence: Fence, boxes: Sequence[InTheWay], start: Vector, goal: Vector, height_m: float
) -> tuple[Point, ...] | None:
    """The corners of a way from above `start` to above `goal`, at this height.

    None: there is no way, or the climb or the descent would break a rule. A drone that is outside
    first flies to a place inside, at this height, and breaks no rule that it does not break now:
    straight to the nearest one that it can reach so, else round what is in the way to one of the
    nearest. Its climb may begin outside.
    """
    above = (*start[:2], height_m)
    kept = [rule for rule in fence.rules if rule.allows(start)]
    if any(rule.meets(start, above) for rule in kept) or any(
        rule.meets((*goal[:2], height_m), goal) for rule in fence.rules
    ):
        return None
    begin = _way_inside(fence, (*boxes, *kept), above) if fence.why_not(above) else ()
    if begin is None:
        return None
    entry = (start[:2], *begin)[-1]
    corners = way_round([*boxes, *fence.rules], entry, goal[:2], height_m)
    return None if corners is None else (*begin, *corners)


def _way_inside(fence: Fence, shut: Sequence[InTheWay], start: Vector) -> tuple[Point, ...] | None:
    """The corners of a way from outside past what is `shut` for it, the last one inside."""
    places = list(fence.places_inside(start))
    for place in places:
        if not any(one.meets(start, place) for one in shut):
            return (place[:2],)
    for place in places[:MOST_ENTRIES]:
        way = way_round(shut, start[:2], place[:2], start[2])
        corners = [(x, y, start[2]) for x, y in (start[:2], *(way or ()))]
        if way and all(
            fence.outside_share(*leg) > ALL_OUTSIDE for leg in zip(corners, corners[1:])
        ):
            return (*way, place[:2])
    return None


def way_round(
    obstacles: Sequence[InTheWay], start: Point, goal: Point, height_m: float
) -> tuple[Point, ...] | None:
    """The corners (x, y in metres) of the shortest path from start to goal at this height.

    None: there is no path, it passes more than MOST_MET obstacles, or a search would try more than
    MOST_LEGS legs. Only those that the path meets count: each search adds what the previous path
    met.
    """
    met: list[InTheWay] = []
    while len(met) <= MOST_MET:
        way = _shortest(met, start, goal, height_m)
        if way is None:
            return None
        new = [
            one
            for one in obstacles
            if one not in met and any(_is_met(one, *leg, height_m) for leg in zip(way, way[1:]))
        ]
        if not new:
            return way[1:-1]
        met += new
    return None


def _shortest(
    obstacles: Sequence[InTheWay], start: Point, goal: Point, height_m: float
) -> tuple[Point, ...] | None:
    """A* over their corners; two see each other if nothing is between them.

    That is asked only of legs that the shortest way may have: it takes most of the time.
    """
    left = MOST_LEGS
    turns = [Turn(start), Turn(goal), *_of_use(obstacles, (start, goal), height_m)]
    near = list(obstacles)
    came_from: dict[int, int] = {}
    waiting = [(0.0, 0.0, 0, 0)]  # least total length, length so far, point, previous point
    while waiting and left:
        _least, metres, here, before = heapq.heappop(waiting)
        at = turns[here].at
        leg = turns[before].at, at
        if here in came_from:
            continue
        left -= 1
        in_the_way = next((one for one in near if here and _is_met(one, *leg, height_m)), None)
        if in_the_way is not None:
            near.sort(key=lambda one: one is not in_the_way)  # it is in the way of the next, too
            continue
        came_from[here] = before
        if here == 1:
            way = [1]
            while way[-1] != 0:
                way.append(came_from[way[-1]])
            return tuple(turns[index].at for index in reversed(way))
        for other, turn in enumerate(turns):
            if other in came_from or not turn.is_touched_from(at):
                continue
            if turns[here].is_touched_from(turn.at):
                until = metres + math.dist(at, turn.at)
                heapq.heappush(waiting, (until + math.dist(turn.at, goal), until, other, here))
    return None


def _of_use(
    obstacles: Sequence[InTheWay], ends: tuple[Point, Point], height_m: float
) -> Iterator[Turn]:
    """Their turns; those in the bays of one only if an end or another one may be in there."""
    turns = [one.turns(height_m) for one in obstacles]
    reach = [box_around([turn.at for turn in some] or [(math.inf, math.inf)]) for some in turns]
    reach += [box_around([end]) for end in ends]
    for number, some in enumerate(turns):
        others = (other for other in reach if other is not reach[number])
        is_visited = any(overlap(reach[number], other) for other in others)
        yield from (turn for turn in some if is_visited or not turn.in_bay)


def _is_met(one: InTheWay, a: Point, b: Point, height_m: float) -> bool:
    return one.meets((*a, height_m), (*b, height_m))
