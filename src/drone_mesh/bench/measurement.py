"""Measures one fleet, from its launch to the figures of its table row."""

from __future__ import annotations

import time
from dataclasses import dataclass

from drone_mesh.bench.observation import REST, TAKE_OFF, WATCH, StateSample
from drone_mesh.bench.processes import Use, cores_between
from drone_mesh.bench.system import BenchmarkError, System
from drone_mesh.state.figures import DELIVERED, LOST_IN_RANGE, WORST_LAG

SETTLE_S = 5.0  # wall; the start costs more than later seconds
SAMPLE_WITHIN_S = 20.0  # wall
MEGABYTE = 1e6


@dataclass(frozen=True)
class RosResult:
    """The figures of one fleet. None: not counted, or it never happened."""

    drones: int
    spacing_m: float
    real_time_factor: float  # as requested; 0: as fast as possible
    flying: int  # drones, at the end; physics moves them
    on_after_wall_s: float  # from roslaunch to the moment all nodes are on
    connected_after_sim_s: float | None  # from the start of the last node to all connected
    connected_after_wall_s: float | None
    routers_connected: int  # at the end
    window_wall_s: float  # the duration of the measurements below
    window_sim_s: float
    messages_per_wall_s: float  # counted as totalMessages: broadcasts are not
    messages_per_sim_s: float
    deliveries_per_wall_s: float | None  # packets that reached a node, broadcasts too
    lost_share: float | None  # of all packets for nodes in range
    lost_before: float | None  # lost before the window, while nodes were starting
    cpu_ms_per_message: float | None  # of all processes, the master's included
    cores: dict[str, float]  # by process
    links: int  # pairs of neighbours, at the end
    cpu_ms_per_sim_s_and_link: float | None
    pss_mb: float  # of all processes
    rss_mb: float
    threads: int
    open_files: int
    reached_real_time_factor: float
    worst_timer_lag_s: float | None  # simulated; since the start


@dataclass(frozen=True)
class _Moment:
    sample: StateSample
    use: Use
    delivered: float | None
    delivered_s: float  # when `delivered` arrived: once a second, independent of the sample
    lost: float | None


def measure(system: System, window_s: float) -> RosResult:
    """Wait until all are connected, and measure `window_s` wall seconds.

    Raises BenchmarkError when the fleet ends by itself.
    """
    system.await_connected()
    _sleep(system, SETTLE_S, "waiting for the start to settle")
    if system.case.flying:
        system.order(TAKE_OFF)
        _sleep(system, SETTLE_S, "waiting for the flights to begin")
    first = _take_moment(system)
    system.order(REST)
    _sleep(system, window_s, "measuring")
    system.order(WATCH)
    last = _take_moment(system)
    result = _result(system, first, last)
    system.progress.say("stopping")
    return result


def _take_moment(system: System) -> _Moment:
    """The current figures. The first state may be old, so wait for the second."""
    watch = system.watch
    seen = len(watch.samples)
    if not system.wait_for(lambda: len(watch.samples) >= seen + 2, SAMPLE_WITHIN_S):
        raise BenchmarkError(f"no /mesh/state for {SAMPLE_WITHIN_S:g} s")
    sample = watch.samples[-1]
    return _Moment(
        sample,
        system.use(),
        watch.total(DELIVERED),
        watch.received_s(DELIVERED),
        watch.total(LOST_IN_RANGE),
    )


def _result(system: System, first: _Moment, last: _Moment) -> RosResult:
    case, watch = system.case, system.watch
    assert watch.all_on is not None
    wall_s = last.sample.wall_s - first.sample.wall_s
    sim_s = last.sample.sim_s - first.sample.sim_s
    messages = last.sample.messages - first.sample.messages
    delivered = _increase(first.delivered, last.delivered)
    lost = _increase(first.lost, last.lost)
    cores, links = cores_between(first.use, last.use), last.sample.links
    cpu_ms = 1000.0 * sum(cores.values()) * wall_s
    connected, processes = watch.all_connected, last.use.processes.values()
    return RosResult(
        drones=case.drones,
        spacing_m=case.spacing_m,
        real_time_factor=case.real_time_factor,
        flying=last.sample.flying,
        on_after_wall_s=watch.all_on.wall_s - system.launched_s,
        connected_after_sim_s=watch.connected_after_s(),
        connected_after_wall_s=connected.wall_s - watch.all_on.wall_s if connected else None,
        routers_connected=last.sample.connected,
        window_wall_s=wall_s,
        window_sim_s=sim_s,
        messages_per_wall_s=messages / wall_s,
        messages_per_sim_s=messages / sim_s if sim_s else 0.0,
        deliveries_per_wall_s=_rate(delivered, last.delivered_s - first.delivered_s),
        lost_share=_share(lost, delivered),
        lost_before=first.lost,
        cpu_ms_per_message=cpu_ms / messages if messages else None,
        cores=cores,
        links=links,
        cpu_ms_per_sim_s_and_link=cpu_ms / sim_s / links if sim_s and links else None,
        pss_mb=sum(process.pss_bytes for process in processes) / MEGABYTE,
        rss_mb=sum(process.rss_bytes for process in processes) / MEGABYTE,
        threads=sum(process.threads for process in processes),
        open_files=sum(process.open_files for process in processes),
        reached_real_time_factor=sim_s / wall_s,
        worst_timer_lag_s=watch.worst.get(WORST_LAG),
    )


def _increase(before: float | None, after: float | None) -> float | None:
    return None if before is None or after is None else after - before


def _rate(increase: float | None, seconds: float) -> float | None:
    return None if increase is None or seconds <= 0.0 else increase / seconds


def _share(lost: float | None, delivered: float | None) -> float | None:
    if lost is None or delivered is None or lost + delivered == 0:
        return None
    return lost / (lost + delivered)


def _sleep(system: System, seconds: float, what: str) -> None:
    until_s = time.monotonic() + seconds
    system.wait_for(
        lambda: time.monotonic() >= until_s,
        seconds + 1.0,
        lambda: f"{what}: {max(0.0, until_s - time.monotonic()):.0f} s",
    )
