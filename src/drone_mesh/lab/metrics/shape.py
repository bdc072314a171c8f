"""Metrics of the shape of the mesh: parts, hops, degree, coverage."""

from __future__ import annotations

from typing import Sequence

import numpy as np

from drone_mesh.lab.metrics.registry import mean, metric
from drone_mesh.lab.record import RunRecord, Topology


@metric("parts", "connected parts right before the fault (or at the start)")
def parts_before(run: RunRecord) -> float:
    return len(_before(run).graph.parts())


@metric("parts", "connected parts at the end", better="less")
def parts_after(run: RunRecord) -> float:
    return len(run.end.graph.parts())


@metric("hops", "mean length of the routes in use right before the fault")
def hops_mean_before(run: RunRecord) -> float:
    return mean(_before(run).route_hops.values())


@metric("hops", "mean length of the routes in use at the end", better="less")
def hops_mean_after(run: RunRecord) -> float:
    return mean(run.end.route_hops.values())


@metric("hops", "longest route in use right before the fault")
def hops_max_before(run: RunRecord) -> float:
    return max(_before(run).route_hops.values(), default=0)


@metric("hops", "longest route in use at the end", better="less")
def hops_max_after(run: RunRecord) -> float:
    return max(run.end.route_hops.values(), default=0)


@metric(
    "ratio",
    "hops of the route in use divided by those of the shortest path, mean of the served routers at "
    "the end",
    better="less",
)
def stretch(run: RunRecord) -> float:
    shortest = run.end.graph.hops_from(sorted(run.gateways))
    return mean(
        hops / shortest[node] for node, hops in run.end.route_hops.items() if shortest.get(node)
    )


@metric("neighbours", "mean number of drones in range of a live drone at the end")
def degree_after(run: RunRecord) -> float:
    return run.end.graph.mean_degree()


@metric(
    "share",
    "ground within range of a drone at the end, relative to that before the fault",
    better="more",
)
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
