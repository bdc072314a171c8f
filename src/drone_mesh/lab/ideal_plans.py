"""Where `nearest` and `inward` fly after the death of one node, with ideal information.

Distances on a plane, no packets and no delays: the bound for the runs of the strategies.
"""

from __future__ import annotations

import functools
from typing import AbstractSet, Callable, Dict, Mapping

from drone_mesh.air.graph import Graph, within
from drone_mesh.communication.repair.strategies import MOVES
from drone_mesh.drone.location import Location

Places = Dict[int, Location]
Flown = Dict[int, float]  # node -> metres

ROUNDING_M = 1e-9  # drones at half the range on opposite sides of a point are in range
_ROOT = 0  # the gateway


def cut_off(places: Places, range_m: float) -> AbstractSet[int]:
    """The nodes without a path to the gateway, which has id 0."""
    graph = Graph(within(places, range_m + ROUNDING_M))
    return places.keys() - graph.hops_from([_ROOT]).keys()


def nearest(
    places: Places, hole: Location, range_m: float, all_act: bool = False
) -> tuple[Places, Flown]:
    """The nearest drone, of those cut off or of all, moves into the hole.

    Its own place is then the next hole.
    """
    acting = places.keys() if all_act else cut_off(places, range_m)
    now = dict(places)
    flown: Flown = {}
    while cut_off(now, range_m):
        free = [n for n in acting - flown.keys() if hole.distance_m(now[n]) < range_m]
        if not free:
            break
        mover = min(free, key=lambda n: (hole.distance_m(now[n]), n))
        flown[mover] = hole.distance_m(now[mover])
        now[mover], hole = hole, now[mover]
    return now, flown


def inward(
    places: Places, hole: Location, range_m: float, all_act: bool = False
) -> tuple[Places, Flown]:
    """The drones beside the dead node, of those cut off or of all, move towards the hole.

    The others follow.
    """
    acting = places.keys() if all_act else cut_off(places, range_m)
    now = dict(places)
    flown: Flown = {}
    first = [n for n in acting if hole.distance_m(places[n]) < range_m]
    for move in range(MOVES):
        if not cut_off(now, range_m):
            break
        before = dict(now)
        for node in first:
            away_m = hole.distance_m(now[node])
            step_m = min(away_m, range_m / 2) if move else max(0.0, away_m - range_m / 2)
            _fly(node, now[node].towards(hole, step_m), now, flown)
        _follow(before, now, flown, acting - set(first), range_m)
    return now, flown


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


IdealPlan = Callable[[Places, Location, float], "tuple[Places, Flown]"]
"""(places after, metres flown) for the places of the survivors, the dead node's and the range."""

IDEAL_PLANS: Mapping[str, IdealPlan] = {
    "nearest": nearest,
    "inward": inward,
    "nearest_of_all": functools.partial(nearest, all_act=True),
    "inward_of_all": functools.partial(inward, all_act=True),
}
