"""The flights of `nearest` and `inward` with ideal information, after the death of one node.

Distances on a plane, no packets and no delays: the bound for the runs in cut_vertices.py.
"""

from __future__ import annotations

from typing import AbstractSet, Dict, Sequence

from drone_mesh.communication.repair.strategies.inward import MOVES
from drone_mesh.drone.location import Location
from drone_mesh.lab.random_layouts import Point

Places = Dict[int, Location]
Flown = Dict[int, float]  # node -> metres

ROUNDING_M = 1e-9  # drones at half the range on opposite sides of a point are in range


def without(points: Sequence[Point], dead: int) -> Places:
    """The positions of the survivors."""
    return {node: place(point) for node, point in enumerate(points) if node != dead}


def place(point: Point) -> Location:
    """A point (x, y) in metres, on the ground."""
    return Location.from_vector((*point, 0.0))


def cut_off(places: Places, range_m: float, root: int) -> frozenset[int]:
    """The nodes that are not reachable from `root` by hops shorter than `range_m`."""
    known, edge = {root}, [root]
    while edge:
        here = places[edge.pop()]
        near = [n for n, p in places.items() if n not in known and _reach(here, p, range_m)]
        known.update(near)
        edge.extend(near)
    return frozenset(places.keys() - known)


def nearest(places: Places, hole: Location, range_m: float, acting: AbstractSet[int]) -> Flown:
    """The nearest drone of `acting` moves into the hole; its own place is then the next hole."""
    places = dict(places)
    flown: Flown = {}
    while cut_off(places, range_m, 0):
        free = [n for n in acting - flown.keys() if hole.distance_m(places[n]) < range_m]
        if not free:
            break
        mover = min(free, key=lambda n: (hole.distance_m(places[n]), n))
        flown[mover] = hole.distance_m(places[mover])
        places[mover], hole = hole, places[mover]
    return flown


def inward(places: Places, hole: Location, range_m: float, acting: AbstractSet[int]) -> Flown:
    """The drones of `acting` beside the dead node move towards the hole; the others follow."""
    now = dict(places)
    flown: Flown = {}
    first = [n for n in acting if hole.distance_m(places[n]) < range_m]
    for move in range(MOVES):
        if not cut_off(now, range_m, 0):
            break
        before = dict(now)
        for node in first:
            away_m = hole.distance_m(now[node])
            step_m = min(away_m, range_m / 2) if move else max(0.0, away_m - range_m / 2)
            _fly(node, now[node].towards(hole, step_m), now, flown)
        _follow(before, now, flown, acting - set(first), range_m)
    return flown


def _follow(
    before: Places, now: Places, flown: Flown, rest: AbstractSet[int], range_m: float
) -> None:
    """A node that loses neighbours that moved follows the nearest of them, up to the range."""
    moved = {node for node in now if now[node] != before[node]}
    rest = set(rest)
    while moved:
        leaders, moved = moved, set()
        for node in sorted(rest):
            lost = [
                m for m in leaders
                if _reach(before[node], before[m], range_m)
                and not _reach(now[node], now[m], range_m)
            ]  # fmt: skip
            if lost:
                leader = min(lost, key=lambda m, me=node: (now[me].distance_m(now[m]), m))  # type: ignore[misc]
                way_m = now[node].distance_m(now[leader]) - range_m
                _fly(node, now[node].towards(now[leader], way_m), now, flown)
                moved.add(node)
        rest -= moved


def _reach(one: Location, other: Location, range_m: float) -> bool:
    return one.distance_m(other) < range_m + ROUNDING_M


def _fly(node: int, goal: Location, now: Places, flown: Flown) -> None:
    way_m = now[node].distance_m(goal)
    if way_m > ROUNDING_M:
        flown[node] = flown.get(node, 0.0) + way_m
        now[node] = goal
