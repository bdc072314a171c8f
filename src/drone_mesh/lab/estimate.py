"""Estimates the duration of an experiment, from trial runs of its own cells."""

from __future__ import annotations

import statistics
import time
from typing import NamedTuple, Sequence

from drone_mesh.errors import MeshError
from drone_mesh.lab.plan import Plan, RunSpec
from drone_mesh.lab.worker import execute, measured, quiet_nodes, scenario_of, simulation_of

BUDGET_S = 20.0  # of trial runs
MOST_CELLS = 60  # cells that get a trial; if there are more, every n-th one does
MOST_TRIALS = 8  # per cell, if there are several cells
ENOUGH_TRIALS = 40  # for a few cells together
LEAST_SHARE = 0.25  # least simulated share of a run in a trial: the start is not typical
START_S = 2.5  # time in which local workers start and load the code
TASK_S = 0.004  # additional time per run: scheduling, storing


class Estimate(NamedTuple):
    """The seconds that the experiment needs on otherwise idle cores."""

    wall_s: float
    run_s: float  # mean of one run
    trials: int


class EstimateError(MeshError):
    """A run of this experiment fails."""


def estimate(plan: Plan, workers: int) -> Estimate:
    """Try every cell once, or every n-th of many; repeat them while there is time.

    A trial of a long run is cut off and extrapolated, so that each cell has one. Raises
    EstimateError if a trial fails.
    """
    most_trials = min(plan.seeds, max(MOST_TRIALS, ENOUGH_TRIALS // len(plan.cells)))
    by_cell: dict[int, list[RunSpec]] = {}
    for planned in plan:
        if planned.is_control:
            continue
        if planned.spec.repetition >= most_trials:
            break
        by_cell.setdefault(planned.cell, []).append(planned.spec)
    stride = -(-len(by_cell) // MOST_CELLS)
    cells = [by_cell[cell] for cell in list(by_cell)[::stride]]
    most_s = BUDGET_S / len(cells)
    _trial(cells[0][0], most_s)  # loads the modules of a first run
    trials: list[list[float]] = [[] for _ in cells]
    started_s = time.process_time()
    for repetition in range(most_trials):
        for specs, found in zip(cells, trials):
            if repetition and time.process_time() - started_s > BUDGET_S:
                break
            found.append(_trial(specs[repetition], most_s))
    run_s = statistics.mean(map(statistics.mean, trials))
    wall_s = len(plan) * (run_s + TASK_S) / max(1, workers) + (START_S if workers else 0.0)
    return Estimate(wall_s, run_s, sum(map(len, trials)))


def _trial(spec: RunSpec, most_s: float) -> float:
    """The cost of a run, in seconds of this process's processor time."""
    started_s = time.process_time()
    if scenario_of(spec.scenario).model == "ideal":
        outcome = execute(spec)
        if outcome.failure:
            raise EstimateError(f"a trial run failed: {outcome.message}")
        return time.process_time() - started_s
    try:
        with quiet_nodes():
            return _try_packets(spec, most_s)
    except Exception as error:  # a user's technique may raise anything
        message = " ".join(str(error).split())
        raise EstimateError(f"a trial run failed: {type(error).__name__}: {message}") from error


def _try_packets(spec: RunSpec, most_s: float) -> float:
    started_s = time.process_time()
    simulation = simulation_of(spec)
    duration_s = simulation.scenario.duration_s
    # Simulated seconds, and the processor time until then.
    samples = [(0.0, time.process_time() - started_s)]
    for now_s in simulation.samples():
        samples.append((now_s, time.process_time() - started_s))
        if samples[-1][1] > most_s and LEAST_SHARE * duration_s <= now_s < duration_s:
            return _extrapolated(samples, duration_s)
    measured(simulation.record(), spec.own_metrics)
    simulation.event_hash()
    return time.process_time() - started_s


def _extrapolated(samples: Sequence[tuple[float, float]], duration_s: float) -> float:
    """Extrapolate from the second half of the samples, because a start costs more than the rest."""
    now_s, spent_s = samples[-1]
    half_s, spent_at_half_s = next(sample for sample in samples if sample[0] >= now_s / 2)
    if half_s == now_s:
        half_s, spent_at_half_s = samples[0]
    rate = (spent_s - spent_at_half_s) / (now_s - half_s)
    return spent_s + rate * (duration_s - now_s)
