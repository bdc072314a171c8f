"""Runs beside busy loops: does an overloaded machine lose connections?"""

from __future__ import annotations

import contextlib
import subprocess
import sys
from dataclasses import dataclass
from typing import Iterator, Sequence

from drone_mesh.bench.system import CONNECTED_WITHIN_S, BenchmarkError, System

SIMULATED_S = 300.0
SECOND_WITHIN_S = 60.0  # wall, for each simulated second; slower counts as stopped


@dataclass(frozen=True)
class OverloadResult:
    """One fleet beside a number of busy loops."""

    drones: int
    spacing_m: float
    busy_loops: int
    simulated_s: float
    wall_s: float
    disconnected: int  # events of any node
    routers_connected: int  # at the end

    @property
    def reached_real_time_factor(self) -> float:
        """Simulated seconds per second."""
        return self.simulated_s / self.wall_s


@contextlib.contextmanager
def busy_loops(count: int) -> Iterator[None]:
    """`count` processes that loop without waiting.

    Each has its own session; otherwise the kernel's autogroups would give all of them together only
    one share of the processor time.
    """
    command = [sys.executable, "-c", "while True: pass"]
    loops = [subprocess.Popen(command, start_new_session=True) for _ in range(count)]
    try:
        yield
    finally:
        for loop in loops:
            loop.kill()
        for loop in loops:
            loop.wait()


def overload(system: System, counts: Sequence[int], simulated_s: float) -> Iterator[OverloadResult]:
    """Run a fleet, once all are connected, beside each number of busy loops in turn.

    Raises BenchmarkError if the fleet does not connect, ends by itself or stops.
    """
    if not system.await_connected():
        raise BenchmarkError(f"not all connected after {CONNECTED_WITHIN_S:g} s")
    for count in counts:
        with busy_loops(count):
            result = _run(system, count, simulated_s)
        system.progress.clear()
        yield result


def _run(system: System, count: int, simulated_s: float) -> OverloadResult:
    case, watch = system.case, system.watch
    first = last = watch.last
    assert first is not None
    assert last is not None
    passed_s = 0.0

    def words() -> str:
        return (
            f"{count} busy loops: simulated {passed_s:.0f} s of {simulated_s:g} s, "
            f"{watch.disconnected_since(first.sim_s)} disconnected"
        )

    while passed_s < simulated_s:
        passed_s = min(simulated_s, passed_s + 1.0)
        second = f"{count} busy loops: a simulated second"
        last = system.wait_until_s(first.sim_s + passed_s, SECOND_WITHIN_S, words, second)
    return OverloadResult(
        drones=case.drones,
        spacing_m=case.spacing_m,
        busy_loops=count,
        simulated_s=last.sim_s - first.sim_s,
        wall_s=last.wall_s - first.wall_s,
        disconnected=watch.disconnected_since(first.sim_s),
        routers_connected=last.connected,
    )
