"""Metrics of movement: distances, flights, and drones that came too close."""

from __future__ import annotations

import math

import numpy as np

from drone_mesh.air.graph import Graph
from drone_mesh.lab.metrics.registry import NAN, metric, metrics
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
    better="less",
    distance_total_m="distance over ground of all flights for repairs and orders, not of pilots",
    distance_max_m="the longest distance that one drone flew",
    distance_mean_m="mean distance of the drones that moved; 0 when none did",
)
def distances(run: RunRecord) -> tuple[float, float, float]:
    flown = _flown(run).values()
    total_m = sum(flown)
    return total_m, max(flown, default=0.0), total_m / len(flown) if flown else 0.0


@metric("drones", "drones that flew", better="less")
def moved(run: RunRecord) -> float:
    return len(_flown(run))


@metric("", "take-offs for repairs and orders, not with pilots", better="less")
def flights(run: RunRecord) -> float:
    return sum(leg.is_start for leg in run.legs)


@metric("", "flights that a router decided on although it had a path to a gateway", better="less")
def false_flights(run: RunRecord) -> float:
    return sum(leg.had_path for leg in run.legs)


@metric("s", "time in flight of all drones", better="less")
def flight_time_s(run: RunRecord) -> float:
    return sum(min(leg.end_s, run.end_s) - leg.path.start_s for leg in run.legs)


@metrics(
    "m",
    better="less",
    displacement_mean_m="mean distance of a live drone from where it started",
    displacement_max_m="the largest of these",
)
def displacements(run: RunRecord) -> tuple[float, float]:
    moved_m = _displacements(run) or [0.0]
    return sum(moved_m) / len(moved_m), max(moved_m)


@metric("drones", "live drones more than 1 m from where they started", better="less")
def displaced(run: RunRecord) -> float:
    return sum(metres > DISPLACED_M for metres in _displacements(run))


def _displacements(run: RunRecord) -> list[float]:
    return [
        math.dist(run.start.places[node][:2], run.end.places[node][:2])
        for node in sorted(run.end.graph.near)
    ]


@metric(
    "", "pairs of live drones nearer than 0.3 m at some time, one of them in flight", better="less"
)
def collisions(run: RunRecord) -> float:
    return run.collisions


@metric("m", "smallest distance of a drone in flight to another; empty: no flight", better="more")
def min_distance_m(run: RunRecord) -> float:
    return run.min_distance_m if math.isfinite(run.min_distance_m) else NAN


@metric(
    "drones", "live drones within 0.3 m of another at the end, and not at the start", better="less"
)
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


@metric(
    "s", "from the last layout ordered until all that can be reached are at their places",
    better="less", censored=True,
)  # fmt: skip
def formation_s(run: RunRecord) -> float:
    given_s, reached_s = run.formations.given_s, run.formations.reached_s
    return NAN if given_s is None or reached_s is None else reached_s - given_s


@metric(
    "s", "by which this is longer than the plan, made when all these had a path",
    better="less", censored=True,
)  # fmt: skip
def formation_late_s(run: RunRecord) -> float:
    return formation_s(run) - run.formations.planned_s


@metric("drones", "drones of the last layout that can be reached and are elsewhere at the end")
def astray(run: RunRecord) -> float:
    return NAN if run.formations.given_s is None else float(len(run.formations.missing))


@metric("", "flights that an obstacle did not allow", better="less")
def flights_blocked(run: RunRecord) -> float:
    return run.refused_flights
