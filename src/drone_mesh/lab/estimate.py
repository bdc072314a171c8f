"""How long an experiment will take, from a few trial runs of its own."""

from __future__ import annotations

import statistics
import time
from typing import NamedTuple

from drone_mesh.errors import MeshError
from drone_mesh.lab.plan import Plan, RunSpec
from drone_mesh.lab.worker import execute

BUDGET_S = 6.0  # of trial runs
START_S = 2.5  # until local workers have started and loaded the code
TASK_S = 0.004  # per run beside its own time: scheduling, storing


class Estimate(NamedTuple):
    """Wall time."""

    wall_s: float
    run_s: float  # mean of one run
    trials: int


class EstimateError(MeshError):
    """A run of this experiment fails."""


def estimate(plan: Plan, workers: int) -> Estimate:
    """Times runs that are spread over the plan's cells, each cell as often as the others.

    Raises EstimateError when one of them fails.
    """
    by_cell: dict[int, list[RunSpec]] = {}
    for planned in plan:
        if planned.spec.repetition >= 8:
            break
        by_cell.setdefault(planned.cell, []).append(planned.spec)
    cells = list(by_cell)
    stride = max(1, len(cells) // 40)
    chosen = cells[::stride]
    spent = {cell: [] for cell in chosen}  # type: dict[int, list[float]]
    started = time.perf_counter()
    execute(by_cell[chosen[0]][0])  # loads what a first run loads
    for repetition in range(8):
        for cell in chosen:
            specs = by_cell[cell]
            if repetition < len(specs):
                outcome = execute(specs[repetition])
                if outcome.failure:
                    raise EstimateError(f"a trial run failed: {outcome.message}")
                spent[cell].append(outcome.wall_s)
            if time.perf_counter() - started > BUDGET_S:
                break
        if time.perf_counter() - started > BUDGET_S:
            break
    means = [statistics.mean(times) for times in spent.values() if times]
    run_s = statistics.mean(means)
    wall_s = START_S + len(plan) * (run_s + TASK_S) / workers
    return Estimate(wall_s, run_s, sum(map(len, spent.values())))
