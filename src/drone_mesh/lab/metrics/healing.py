"""Metrics of healing: whether, when, and the outages of routers meanwhile."""

from __future__ import annotations

import math
import statistics
from typing import Iterable

from drone_mesh.communication.events.observer import MeshEventKind
from drone_mesh.lab.metrics.registry import NAN, less, metric, metrics, more, percentiles
from drone_mesh.lab.record import RunRecord
from drone_mesh.state.model import EventRecord


@more("0/1", "all live routers are served again, for 5 s, before the end")
def healed(run: RunRecord) -> float:
    return run.healed_at_s is not None


@metric("0/1", "the fault left a live router without any path to a gateway")
def split(run: RunRecord) -> float:
    return NAN if run.after_fault is None else float(cut_off(run) > 0)


@metric("drones", "live routers without any path to a gateway right after the fault")
def cut_off(run: RunRecord) -> float:
    if run.after_fault is None:
        return NAN
    return len(run.after_fault.near) - len(run.after_fault.hops_from(sorted(run.gateways)))


@metric(
    "drones",
    "drones that faults switched off during the run; "
    "not those of which an incident only silences the antenna",
)
def victims(run: RunRecord) -> float:
    deadly = ("kill", "gateway_off", "battery empty", "death")
    return len({n for item in run.happened if item.action in deadly for n in item.nodes})


@less(
    "s",
    "from the fault until all live routers are served for 5 s; empty: not healed",
    censored=True,
)
def t_total_s(run: RunRecord) -> float:
    if run.healed_at_s is None or run.fault_s is None:
        return NAN
    return run.healed_at_s - run.fault_s


@metric(
    "s",
    "t_total_s, or observed_s if not healed; "
    "only for comparison with published means that include such runs",
)
def t_capped_s(run: RunRecord) -> float:
    total_s = t_total_s(run)
    return observed_s(run) if math.isnan(total_s) else total_s


@metrics(
    "s",
    t_detect_s="of t_total_s: until the first router notices that it has lost its gateway",
    t_decide_s="of t_total_s: from there until the first drone decides to fly; 0 without flight",
    t_fly_s="of t_total_s: from there until the last landing; 0 without flight",
    t_reroute_s="of t_total_s: the rest",
)
def phases(run: RunRecord) -> tuple[float, float, float, float]:
    """The four phases, which add up to t_total_s."""
    start_s, end_s = run.fault_s, run.healed_at_s
    if start_s is None or end_s is None:
        return (NAN, NAN, NAN, NAN)
    between = [event for event in run.events if start_s <= event.stamp_s <= end_s]
    if start_s == end_s:
        return (0.0, 0.0, 0.0, 0.0)
    died = {(item.at_s, node) for item in run.happened for node in item.nodes}
    # A drone that is switched off loses its own connection at that moment.
    noticed = _first(
        (event for event in between if (event.stamp_s, event.node) not in died),
        MeshEventKind.DISCONNECTED,
    )
    decided = _first(between, MeshEventKind.FLIGHT_DECIDED)
    landings = [event.stamp_s for event in between if event.kind == MeshEventKind.LANDED.value]
    decided_s = end_s if decided is None else decided
    noticed_s = min(decided_s, end_s if noticed is None else noticed)
    if decided is None:
        return (noticed_s - start_s, 0.0, 0.0, end_s - noticed_s)
    landed_s = max([decided_s, *landings])
    return (noticed_s - start_s, decided_s - noticed_s, landed_s - decided_s, end_s - landed_s)


@metric("s", "from the fault to the end of the run: where an unhealed run is censored")
def observed_s(run: RunRecord) -> float:
    return NAN if run.fault_s is None else run.end_s - run.fault_s


@less("s", "from the start until all routers are served for the first time")
def connected_s(run: RunRecord) -> float:
    return next((sample.now_s for sample in run.samples if sample.share == 1.0), NAN)


@more("share", "served routers, mean over the time since all were served for the first time")
def steady_share(run: RunRecord) -> float:
    first_s = connected_s(run)
    shares = [sample.share for sample in run.samples if sample.now_s >= first_s]
    return statistics.fmean(shares) if shares else 0.0


@more("share", "live routers that are served at the end")
def connected_share(run: RunRecord) -> float:
    return run.samples[-1].share


@more("share", "served routers, mean over the time since the fault")
def uptime(run: RunRecord) -> float:
    begin_s = 0.0 if run.fault_s is None else run.fault_s
    samples = [sample for sample in run.samples if sample.now_s >= begin_s]
    area = sum(
        (after.now_s - before.now_s) * (before.share + after.share) / 2
        for before, after in zip(samples, samples[1:])
    )
    seconds = samples[-1].now_s - samples[0].now_s
    return area / seconds if seconds else samples[-1].share


def _first(events: Iterable[EventRecord], kind: MeshEventKind) -> float | None:
    return next((event.stamp_s for event in events if event.kind == kind.value), None)


# Outages of single routers ---------------------------------------------------------------------


@less("", "times that a live router was without service since the fault")
def outages(run: RunRecord) -> float:
    return len(run.gaps())


@metrics(
    "s",
    "less",
    outage_median_s="median length of these outages; one without end counts up to the end",
    outage_p95_s="95th percentile of their lengths",
    outage_max_s="length of the longest of these outages",
)
def outage_lengths(run: RunRecord) -> tuple[float, ...]:
    lengths = [gap.seconds(run.end_s) for gap in run.gaps()] or [0.0]
    return statistics.median(lengths), *percentiles(lengths, 0.95), max(lengths)
