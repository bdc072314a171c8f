"""Metrics of batteries, pads and reliefs; empty without `endurance`."""

from __future__ import annotations

from drone_mesh.lab.metrics.registry import NAN, less, metric, metrics, more, ratio
from drone_mesh.lab.record import RunRecord


@more("share", "time that posts are held by a served drone, since all first were")
def posts_held(run: RunRecord) -> float:
    it = run.endurance
    return NAN if it is None else ratio(it.held_post_s, it.watched_s * it.posts)


@less("s", "longest time that a post was not held by a served drone")
def post_gap_s(run: RunRecord) -> float:
    return NAN if run.endurance is None else run.endurance.longest_gap_s


@metric("s", "until less than half of the posts were held, and never more again; empty: they were")
def lived_s(run: RunRecord) -> float:
    it = run.endurance
    return NAN if it is None or it.lived_s is None else it.lived_s


@metrics(
    "drones",
    "less",
    fell="drones whose battery ran empty in the air",
    landed_astray="drones on the ground elsewhere than on their pads at the end",
)
def lost(run: RunRecord) -> tuple[float, float]:
    it = run.endurance
    return (NAN, NAN) if it is None else (len(it.fell), len(it.astray))


@more("%", "least charge of a drone in the air")
def least_charge(run: RunRecord) -> float:
    return NAN if run.endurance is None else run.endurance.least_percent


@metrics(
    "",
    reliefs="drones that left when another one carried their traffic",
    swaps="batteries that were swapped",
)
def turns(run: RunRecord) -> tuple[float, float]:
    it = run.endurance
    return (NAN, NAN) if it is None else (it.reliefs, it.swaps)


@less("Wh", "energy that all drones took from their batteries")
def energy_wh(run: RunRecord) -> float:
    return NAN if run.endurance is None else run.endurance.energy_wh


@metrics(
    "drones",
    spares="drones beyond the posts",
    least_spares="fewer could hold the posts under no schedule; 254: the pads are too slow",
)
def spares_of(run: RunRecord) -> tuple[float, float]:
    it = run.endurance
    return (NAN, NAN) if it is None else (it.spares, it.least_spares)
