"""Metrics of movement, and of the shape of the mesh: distances, flights, parts, hops, coverage."""

from __future__ import annotations

import math
from typing import Sequence

import numpy as np

from drone_mesh.air.graph import Graph
from drone_mesh.lab.metrics.registry import NAN, less, mean, metric, metrics, more
from drone_mesh.lab.record import RunRecord, Topology

DISPLACED_M = 1.0  # the clearance
STACKED_M = 0.3  # two drones closer than this are stacked


def _flown(run: RunRecord) -> dict[int, float]:
    metres: dict[int, float] = {}
    for leg in run.legs:
        metres[leg.node] = metres.get(leg.node, 0.0) + leg.metres_until(run.end_s)
    return metres


@metrics(
    "m",
    "less",
    distance_total_m="distance over ground of all flights for repairs and orders, not of pilots",
    distance_max_m="the longest distance that one drone flew",
    distance_mean_m="mean distance of the drones that moved; 0 when none did",
)
def distances(run: RunRecord) -> tuple[float, float, float]:
    flown = _flown(run).values()
    total_m = sum(flown)
    return total_m, max(flown, default=0.0), total_m / len(flown) if flown else 0.0


@less("drones", "drones that flew")
def moved(run: RunRecord) -> float:
    return len(_flown(run))


@less("", "take-offs for repairs and orders, not with pilots")
def flights(run: RunRecord) -> float:
    return sum(leg.is_start for leg in run.legs)


@less("", "flights that a router decided on although it had a path to a gateway")
def false_flights(run: RunRecord) -> float:
    return sum(leg.had_path for leg in run.legs)


@less("s", "time in flight of all drones")
def flight_time_s(run: RunRecord) -> float:
    return sum(min(leg.end_s, run.end_s) - leg.path.start_s for leg in run.legs)


@metrics(
    "m",
    "less",
    displacement_mean_m="mean distance of a live drone from where it started",
    displacement_max_m="the largest of these",
)
def displacements(run: RunRecord) -> tuple[float, float]:
    moved_m = _displacements(run) or [0.0]
    return sum(moved_m) / len(moved_m), max(moved_m)


@less("drones", "live drones more than 1 m from where they started")
def displaced(run: RunRecord) -> float:
    return sum(metres > DISPLACED_M for metres in _displacements(run))


def _displacements(run: RunRecord) -> list[float]:
    return [
        math.dist(run.start.places[node][:2], run.end.places[node][:2])
        for node in sorted(run.end.graph.near)
    ]


@less("", "pairs of live drones nearer than 0.3 m at some time, one of them in flight")
def collisions(run: RunRecord) -> float:
    return run.collisions


@more("m", "smallest distance of a drone in flight to another; empty: no flight")
def min_distance_m(run: RunRecord) -> float:
    return run.min_distance_m if math.isfinite(run.min_distance_m) else NAN


@less("drones", "live drones within 0.3 m of another at the end, and not at the start")
def stacked(run: RunRecord) -> float:
    return len(_stacked(run.end, run.end.graph) - _stacked(run.start, run.end.graph))


def _stacked(scene: Topology, alive: Graph) -> set[int]:
    nodes = sorted(alive.near)
    points = np.array([scene.places[node] for node in nodes])
    if len(nodes) < 2:
        return set()
    near = np.linalg.norm(points[:, None] - points[None], axis=2) < STACKED_M
    np.fill_diagonal(near, False)
    return {nodes[index] for index in np.flatnonzero(near.any(axis=1))}


@less(
    "s",
    "from the last layout ordered until all that can be reached are at their places",
    censored=True,
)
def formation_s(run: RunRecord) -> float:
    given_s, reached_s = run.formations.given_s, run.formations.reached_s
    return NAN if given_s is None or reached_s is None else reached_s - given_s


@less("s", "by which this is longer than the plan, made when all these had a path", censored=True)
def formation_late_s(run: RunRecord) -> float:
    return formation_s(run) - run.formations.planned_s


@metric("drones", "drones of the last layout that can be reached and are elsewhere at the end")
def astray(run: RunRecord) -> float:
    return NAN if run.formations.given_s is None else float(len(run.formations.missing))


@less("", "flights that an obstacle did not allow")
def flights_blocked(run: RunRecord) -> float:
    return run.refused_flights


@metric("parts", "connected parts right before the fault (or at the start)")
def parts_before(run: RunRecord) -> float:
    return len(_before(run).graph.parts())


@less("parts", "connected parts at the end")
def parts_after(run: RunRecord) -> float:
    return len(run.end.graph.parts())


@metric("hops", "mean length of the routes in use right before the fault")
def hops_mean_before(run: RunRecord) -> float:
    return mean(_before(run).route_hops.values())


@less("hops", "mean length of the routes in use at the end")
def hops_mean_after(run: RunRecord) -> float:
    return mean(run.end.route_hops.values())


@metric("hops", "longest route in use right before the fault")
def hops_max_before(run: RunRecord) -> float:
    return max(_before(run).route_hops.values(), default=0)


@less("hops", "longest route in use at the end")
def hops_max_after(run: RunRecord) -> float:
    return max(run.end.route_hops.values(), default=0)


@less(
    "ratio",
    "hops of the route in use divided by those of the shortest path, mean of the served routers at "
    "the end",
)
def stretch(run: RunRecord) -> float:
    shortest = run.end.graph.hops_from(sorted(run.gateways))
    return mean(
        hops / shortest[node] for node, hops in run.end.route_hops.items() if shortest.get(node)
    )


@metric("neighbours", "mean number of drones in range of a live drone at the end")
def degree_after(run: RunRecord) -> float:
    return run.end.graph.mean_degree()


@more("share", "ground within range of a drone at the end, relative to that before the fault")
def coverage(run: RunRecord) -> float:
    before = _before(run)
    range_m = run.scenario.range_m
    points_before = [before.places[n][:2] for n in sorted(before.graph.near)]
    points_after = [run.end.places[n][:2] for n in sorted(run.end.graph.near)]
    if not points_before or not points_after:
        return 0.0
    return covered(points_after, range_m) / covered(points_before, range_m)


def covered(points: Sequence[Sequence[float]], range_m: float) -> int:
    """The number of cells of a grid, an eighth of the range wide, whose centre is in range."""
    cell = range_m / 8
    places = np.asarray(points, dtype=float)
    cells = np.floor(places / cell).astype(np.int64)[:, :, None] + np.arange(-8, 9)  # (n, 2, 17)
    squares = ((cells + 0.5) * cell - places[:, :, None]) ** 2
    inside = squares[:, 0, :, None] + squares[:, 1, None, :] < range_m**2
    numbers = cells[:, 0, :, None] * 10_000_019 + cells[:, 1, None, :]
    return len(set(numbers[inside].tolist()))  # cheaper than sorting them


def _before(run: RunRecord) -> Topology:
    return run.start if run.before is None else run.before
