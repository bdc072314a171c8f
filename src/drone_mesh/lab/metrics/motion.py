"""Metrics of a moving mesh: its links, whom it serves, and what arrives."""

from __future__ import annotations

import math
import statistics
from typing import Sequence

from drone_mesh.lab.metrics.registry import NAN, mean, metric, per_drone_and_s, ratio
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


@metric("share", "time of these routers in which they are served", better="more")
def served(run: RunRecord) -> float:
    return ratio(run.links.served_s, run.links.reachable_s)


@metric("share", "the same share at the worst of 20 moments (5th percentile)", better="more")
def served_p5(run: RunRecord) -> float:
    return _percentile(run.links.service.shares, 0.05)


@metric("share", "the same share, median over time", better="more")
def served_p50(run: RunRecord) -> float:
    return _percentile(run.links.service.shares, 0.5)


@metric("s", "median time that a router has a path and is not served", better="less")
def lapse_p50_s(run: RunRecord) -> float:
    return _percentile(run.links.service.lapses_s, 0.5)


@metric("s", "99th percentile of these times", better="less")
def lapse_p99_s(run: RunRecord) -> float:
    return _percentile(run.links.service.lapses_s, 0.99)


@metric("share", "connected routers of those with a path at the worst of 20 moments", better="more")
def connected_p5(run: RunRecord) -> float:
    return _percentile(run.links.connection.shares, 0.05)


@metric("share", "the same share, median over time", better="more")
def connected_p50(run: RunRecord) -> float:
    return _percentile(run.links.connection.shares, 0.5)


@metric("s", "median time that a router has a path and is not connected", better="less")
def unconnected_p50_s(run: RunRecord) -> float:
    return _percentile(run.links.connection.lapses_s, 0.5)


@metric("s", "99th percentile of these times", better="less")
def unconnected_p99_s(run: RunRecord) -> float:
    return _percentile(run.links.connection.lapses_s, 0.99)


@metric(
    "share",
    "best-effort messages to the gateway that arrived in time, of drones with a path",
    better="more",
)
def pdr_up(run: RunRecord) -> float:
    return _arrived(run, "up")


@metric("share", "the same from the gateway", better="more")
def pdr_down(run: RunRecord) -> float:
    return _arrived(run, "down")


@metric("share", "echoes of a gateway that a drone with a path answered in time", better="more")
def pdr_echo(run: RunRecord) -> float:
    return _arrived(run, "echo")


@metric("ms", "median time of these messages that arrived, up and down", better="less")
def delay_ms(run: RunRecord) -> float:
    delays = _delays_ms(run)
    return statistics.median(delays) if delays else NAN


@metric("ms", "the time within which 95 % of them arrived", better="less")
def delay_p95_ms(run: RunRecord) -> float:
    return _percentile(_delays_ms(run), 0.95)


@metric("hops", "mean hops of an echo beyond the shortest path at its time", better="less")
def detours(run: RunRecord) -> float:
    return mean(probe.hops - probe.shortest for probe in run.probes if probe.hops is not None)


@metric("1/s", "frames per drone and second, acknowledgements included; shared radio only")
def frame_rate(run: RunRecord) -> float:
    return NAN if run.frames is None else per_drone_and_s(run, sum(run.frames.values()))


@metric("1/s", "of these, frames that carry no data of users", better="less")
def control_frame_rate(run: RunRecord) -> float:
    return NAN if run.frames is None else per_drone_and_s(run, run.frames["control"])


def _percentile(values: Sequence[float], share: float) -> float:
    """The least value that so large a share of the values does not exceed; NaN: no values."""
    return sorted(values)[max(0, math.ceil(share * len(values)) - 1)] if values else NAN


def _delays_ms(run: RunRecord) -> list[float]:
    fates = [probe for probe in run.probes if probe.kind != "echo"]
    return [1000.0 * fate.delay_s for fate in fates if fate.delay_s is not None]


def _arrived(run: RunRecord, kind: str) -> float:
    return mean(probe.delay_s is not None for probe in run.probes if probe.kind == kind)
