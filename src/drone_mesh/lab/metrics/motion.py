"""Metrics of a moving mesh: its links, whom it serves, and what arrives."""

from __future__ import annotations

import statistics

from drone_mesh.lab.metrics.registry import (
    NAN,
    less,
    mean,
    metric,
    metrics,
    more,
    per_drone_and_s,
    percentiles,
    ratio,
)
from drone_mesh.lab.probes import KINDS
from drone_mesh.lab.record import RunRecord


@metric("1/min", "links that appear or disappear, per drone and minute")
def link_changes(run: RunRecord) -> float:
    return ratio(2 * (run.links.appeared + run.links.disappeared), run.links.drone_s / 60.0)


@metric("s", "mean life of a link: time of all links per link that ended; empty: none ended")
def link_life_s(run: RunRecord) -> float:
    return ratio(run.links.link_s, run.links.disappeared)


@metric("share", "time of live routers with any path to a gateway over existing links")
def reachable(run: RunRecord) -> float:
    return ratio(run.links.reachable_s, run.links.router_s)


@more("share", "time of these routers in which they are served")
def served(run: RunRecord) -> float:
    return ratio(run.links.served_s, run.links.reachable_s)


@metrics(
    "share",
    "more",
    served_p5="the same share at the worst of 20 moments (5th percentile)",
    served_p50="the same share, median over time",
)
def service(run: RunRecord) -> list[float]:
    return percentiles(run.links.service.shares, 0.05, 0.5)


@metrics(
    "s",
    "less",
    lapse_p50_s="median time that a router has a path and is not served",
    lapse_p99_s="99th percentile of these times",
)
def lapses(run: RunRecord) -> list[float]:
    return percentiles(run.links.service.lapses_s(run.end_s), 0.5, 0.99)


@metrics(
    "share",
    "more",
    connected_p5="connected routers of those with a path at the worst of 20 moments",
    connected_p50="the same share, median over time",
)
def connection(run: RunRecord) -> list[float]:
    return percentiles(run.links.connection.shares, 0.05, 0.5)


@metrics(
    "s",
    "less",
    unconnected_p50_s="median time that a router has a path and is not connected",
    unconnected_p99_s="99th percentile of these times",
)
def unconnected(run: RunRecord) -> list[float]:
    return percentiles(run.links.connection.lapses_s(run.end_s), 0.5, 0.99)


@metrics(
    "share",
    "more",
    pdr_up="best-effort messages to the gateway that arrived in time, of drones with a path",
    pdr_down="the same from the gateway",
    pdr_echo="echoes of a gateway that a drone with a path answered in time",
    pdr_any="the same as messages from any node to any other with a path (`between: any`)",
)
def delivered(run: RunRecord) -> list[float]:
    return [
        mean(probe.delay_s is not None for probe in run.probes if probe.kind == kind)
        for kind in KINDS
    ]


@metrics(
    "ms",
    "less",
    delay_ms="median time of these messages that arrived, up and down, or between any nodes",
    delay_p95_ms="the time within which 95 % of them arrived",
)
def delays(run: RunRecord) -> tuple[float, float]:
    messages = (probe.delay_s for probe in run.probes if probe.kind != "echo")
    found = [1000.0 * delay_s for delay_s in messages if delay_s is not None]
    (p95_ms,) = percentiles(found, 0.95)
    return statistics.median(found) if found else NAN, p95_ms


@less("hops", "mean hops of an echo beyond the shortest path at its time")
def detours(run: RunRecord) -> float:
    return mean(probe.hops - probe.shortest for probe in run.probes if probe.hops is not None)


@metric("1/s", "frames per drone and second, acknowledgements included; shared radio only")
def frame_rate(run: RunRecord) -> float:
    return NAN if run.frames is None else per_drone_and_s(run, sum(run.frames.values()))


@less("1/s", "of these, frames that carry no data of users")
def control_frame_rate(run: RunRecord) -> float:
    return NAN if run.frames is None else per_drone_and_s(run, run.frames["control"])
