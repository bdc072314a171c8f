"""Measures the speed of the in-process network."""

from __future__ import annotations

import statistics
import time
from dataclasses import dataclass
from typing import Callable

from drone_mesh.bench.cases import Case
from drone_mesh.communication.seals.keys import Keys
from drone_mesh.inprocess import Network

SIZES = (25, 100, 254)
SPACING_M = 6.0
SIMULATED_S = 60.0  # six rounds of the default timing


@dataclass(frozen=True)
class InProcessResult:
    """Several runs of one size: medians, and the best run, which is the least disturbed."""

    drones: int
    spacing_m: float
    runs: int
    simulated_s: float  # of one phase of one run
    # Simulated seconds per second of processor time of the one core that is used, and of wall time.
    from_start_per_cpu_s: float
    from_start_per_wall_s: float
    from_start_best_per_cpu_s: float
    running_per_cpu_s: float
    running_per_wall_s: float
    running_best_per_cpu_s: float
    packets_per_cpu_s: float  # in the second phase
    packets: int  # delivered in both phases of one run
    all_connected: bool


@dataclass(frozen=True)
class SealCost:
    """Packets per second of processor time, best of several runs taken in turns."""

    drones: int
    spacing_m: float
    runs: int
    simulated_s: float
    without_key: float
    with_key: float


@dataclass(frozen=True)
class _Pace:
    per_cpu_s: float
    per_wall_s: float
    packets_per_cpu_s: float


def _pace(network: Network) -> _Pace:
    delivered = network.air.delivered
    wall_s, cpu_s = time.perf_counter(), time.process_time()
    network.run_for(SIMULATED_S)
    wall_s, cpu_s = time.perf_counter() - wall_s, time.process_time() - cpu_s
    packets_per_cpu_s = (network.air.delivered - delivered) / cpu_s
    return _Pace(SIMULATED_S / cpu_s, SIMULATED_S / wall_s, packets_per_cpu_s)


def measure(
    drones: int,
    runs: int,
    say: Callable[[str], None],
    key: Keys | None = None,
) -> InProcessResult:
    """Start a network `runs` times and measure two phases of each run.

    The first phase costs more, because the nodes find each other in it. With a `key`, all packets
    are sealed.
    """
    case = Case(drones, SPACING_M)
    starting: list[_Pace] = []
    running: list[_Pace] = []
    packets, connected = 0, True
    for run in range(runs):
        say(f"{drones} drones in process: run {run + 1} of {runs}")
        network = Network(seed=run, key=key)
        network.add_fleet(1, case.routers, case.gridsize, SPACING_M)
        starting.append(_pace(network))
        running.append(_pace(network))
        packets = network.air.delivered
        connected = connected and network.all_connected()
    return InProcessResult(
        drones=drones,
        spacing_m=SPACING_M,
        runs=runs,
        simulated_s=SIMULATED_S,
        from_start_per_cpu_s=statistics.median(pace.per_cpu_s for pace in starting),
        from_start_per_wall_s=statistics.median(pace.per_wall_s for pace in starting),
        from_start_best_per_cpu_s=max(pace.per_cpu_s for pace in starting),
        running_per_cpu_s=statistics.median(pace.per_cpu_s for pace in running),
        running_per_wall_s=statistics.median(pace.per_wall_s for pace in running),
        running_best_per_cpu_s=max(pace.per_cpu_s for pace in running),
        packets_per_cpu_s=statistics.median(pace.packets_per_cpu_s for pace in running),
        packets=packets,
        all_connected=connected,
    )


def seal_cost(drones: int, runs: int, say: Callable[[str], None], key: Keys) -> SealCost:
    """The pace of a running network without and with a key, `runs` times each."""
    case = Case(drones, SPACING_M)
    without_key, with_key = 0.0, 0.0
    for run in range(runs):
        say(f"{drones} drones in process, without and with a key: run {run + 1} of {runs}")
        for keys in (None, key):
            network = Network(seed=run, key=keys)
            network.add_fleet(1, case.routers, case.gridsize, SPACING_M)
            network.run_for(SIMULATED_S)
            pace = _pace(network).packets_per_cpu_s
            if keys is None:
                without_key = max(without_key, pace)
            else:
                with_key = max(with_key, pace)
    return SealCost(drones, SPACING_M, runs, SIMULATED_S, without_key, with_key)
