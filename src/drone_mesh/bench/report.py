"""The figures as Markdown tables."""

from __future__ import annotations

import functools
import os
import platform
from dataclasses import dataclass
from pathlib import Path
from typing import Callable, Sequence, TypeVar

from drone_mesh.bench.inprocess import InProcessResult, SealCost
from drone_mesh.bench.measurement import RosResult
from drone_mesh.bench.overload import OverloadResult
from drone_mesh.bench.soak import Sample, SoakResult, judge

R = TypeVar("R")

UNKNOWN = "-"
SMALL_CORES = 0.005  # processes that use less have no column


@dataclass(frozen=True)
class Machine:
    """The machine of the measurement."""

    cores: int
    processor: str
    python: str
    load_before: float  # of the last minute, before the start

    @classmethod
    def here(cls) -> Machine:
        """This machine, now."""
        return cls(
            cores=len(os.sched_getaffinity(0)),
            processor=_processor(),
            python=platform.python_version(),
            load_before=os.getloadavg()[0],
        )

    def __str__(self) -> str:
        return (
            f"{self.cores} cores of {self.processor}, Python {self.python}, "
            f"load {self.load_before:.1f} before the start"
        )


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        lines = []
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.machine()


def table(headings: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A Markdown table with aligned columns."""
    widths = [max(len(row[column]) for row in (headings, *rows)) for column in range(len(headings))]
    lines = [headings, ["-" * width for width in widths], *rows]
    return "\n".join(
        "| " + " | ".join(cell.rjust(width) for cell, width in zip(line, widths)) + " |"
        for line in lines
    )


def _columns(results: Sequence[R], *columns: tuple[str, Callable[[R], str]]) -> str:
    """A table with a row for each result; a column is its heading and what it shows."""
    headings = [heading for heading, _show in columns]
    return table(headings, [[show(result) for _heading, show in columns] for result in results])


def ros_tables(results: Sequence[RosResult]) -> str:
    """Three tables: start, traffic, cost."""
    return "\n\n".join(
        (
            "Start, in seconds. Connected: from the start of the last node until all are "
            "connected.",
            _columns(
                results,
                *_FLEET,
                ("all on (wall)", lambda r: f"{r.on_after_wall_s:.1f}"),
                ("connected (sim)", _seconds_or_how_many),
                ("(wall)", lambda r: _number(r.connected_after_wall_s, 1)),
            ),
            "Traffic per second of wall time. Lost: share of the packets for nodes in range, and "
            "the number lost before the measurement, while nodes were starting. Speed of simulated "
            "time.",
            _columns(
                results,
                *_FLEET,
                ("messages/s", lambda r: f"{r.messages_per_wall_s:.0f}"),
                ("deliveries/s", lambda r: _number(r.deliveries_per_wall_s, 0)),
                ("lost", lambda r: UNKNOWN if r.lost_share is None else f"{r.lost_share:.3%}"),
                ("lost at the start", lambda r: _number(r.lost_before, 0)),
                ("factor reached", lambda r: f"{r.reached_real_time_factor:.2f}"),
                ("worst timer lag", lambda r: _milliseconds(r.worst_timer_lag_s)),
            ),
            "Cost. Cores used by each process and by all; milliseconds of processor time of all "
            "per message, and per simulated second and link; memory of all, in MB.",
            _cost_table(results),
        )
    )


def _drones(result: RosResult) -> str:
    return f"{result.drones}, {result.flying} flying" if result.flying else str(result.drones)


def _speed(result: RosResult) -> str:
    factor = result.real_time_factor
    return "as fast as possible" if factor == 0 else f"{factor:g}"


_FLEET: Sequence[tuple[str, Callable[[RosResult], str]]] = (
    ("drones", _drones),
    ("spacing", lambda result: f"{result.spacing_m:g} m"),
    ("speed", _speed),
)


def _seconds_or_how_many(result: RosResult) -> str:
    if result.connected_after_sim_s is None:
        return f"never ({result.routers_connected} of {result.drones - 1})"
    return f"{result.connected_after_sim_s:.1f}"


def _number(value: float | None, digits: int) -> str:
    return UNKNOWN if value is None else f"{value:.{digits}f}"


def _milliseconds(seconds: float | None) -> str:
    return UNKNOWN if seconds is None else f"{1000 * seconds:.0f} ms"


def _cores_of(name: str, result: RosResult) -> str:
    return _number(result.cores.get(name), 2)


def _cost_table(results: Sequence[RosResult]) -> str:
    names = sorted(
        {name for result in results for name, cores in result.cores.items() if cores > SMALL_CORES}
    )
    return _columns(
        results,
        *_FLEET,
        *((name, functools.partial(_cores_of, name)) for name in names),
        ("all", lambda r: f"{sum(r.cores.values()):.2f}"),
        ("ms/message", lambda r: _number(r.cpu_ms_per_message, 2)),
        ("links", lambda r: str(r.links)),
        ("ms/s and link", lambda r: _number(r.cpu_ms_per_sim_s_and_link, 2)),
        ("PSS", lambda r: f"{r.pss_mb:.0f}"),
        ("RSS", lambda r: f"{r.rss_mb:.0f}"),
    )


def inprocess_table(results: Sequence[InProcessResult]) -> str:
    """A table of simulated seconds per second."""
    runs = results[0].runs
    period = f"{results[0].simulated_s:g} simulated seconds"
    return (
        f"In process, one core: simulated seconds per second of processor time (of wall time). "
        f"Medians of {runs} runs and the best run, for the first {period} and the {period} "
        f"after them; packets per second of processor time after them.\n\n"
    ) + _columns(
        results,
        ("nodes", lambda r: str(r.drones)),
        ("spacing", lambda r: f"{r.spacing_m:g} m"),
        (
            "from the start",
            lambda r: f"{r.from_start_per_cpu_s:.0f} ({r.from_start_per_wall_s:.0f})",
        ),
        ("best", lambda r: f"{r.from_start_best_per_cpu_s:.0f}"),
        ("after", lambda r: f"{r.running_per_cpu_s:.0f} ({r.running_per_wall_s:.0f})"),
        ("best", lambda r: f"{r.running_best_per_cpu_s:.0f}"),
        ("packets", lambda r: f"{r.packets_per_cpu_s:.0f}"),
        ("all connected", lambda r: "yes" if r.all_connected else "no"),
    )


def seal_line(cost: SealCost) -> str:
    """What a key costs."""
    return (
        f"{cost.drones} nodes, {cost.spacing_m:g} m, in process: "
        f"{cost.without_key:.0f} packets per second of processor time without a key, "
        f"{cost.with_key:.0f} with one: {1e6 / cost.with_key - 1e6 / cost.without_key:.1f} "
        f"microseconds more per packet (best of {cost.runs} runs)"
    )


def overload_line(result: OverloadResult) -> str:
    """One line per number of busy loops."""
    return (
        f"{result.drones} drones, {result.spacing_m:g} m, {result.busy_loops} busy loops: "
        f"{result.disconnected} disconnected in {result.simulated_s:.0f} simulated seconds, "
        f"{result.routers_connected} routers connected at the end, "
        f"real-time factor {result.reached_real_time_factor:.2f}"
    )


def sample_line(sample: Sample) -> str:
    """One line per sample of a long run."""
    return (
        f"{sample.sim_s / 60:6.0f} min simulated  {sample.wall_s / 60:5.1f} min wall  "
        f"PSS {sample.pss_mb:7.1f} MB  RSS {sample.rss_mb:7.1f} MB  {sample.threads:5d} threads  "
        f"{sample.open_files:5d} files  {sample.routers_connected:3d} connected"
    )


def verdict_lines(result: SoakResult) -> str:
    """The verdict on growth after the first ten minutes."""
    verdict = judge(result.samples)
    if verdict is None:
        return (
            "too short for a verdict on growth: "
            "it needs at least 13 simulated minutes and 90 s of wall time"
        )
    return "\n".join(
        (
            f"memory: {verdict.memory_before_mb:.1f} MB soon after the first ten minutes, "
            f"{verdict.memory_after_mb:.1f} MB at the end: "
            + ("it grew" if verdict.memory_grew else "it did not grow"),
            f"threads: {_span(verdict.threads)}",
            f"open files and connections: {_span(verdict.open_files)}",
            *([f"processes with changes: {', '.join(verdict.changed)}"] if verdict.changed else []),
        )
    )


def _span(span: tuple[int, int]) -> str:
    least, most = span
    return f"{most} throughout" if least == most else f"from {least} to {most}"
