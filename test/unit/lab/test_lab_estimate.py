"""`lab plan`: how long an experiment will take, on a clock that counts packets."""

from __future__ import annotations

import statistics
import time
from pathlib import Path

import pytest

from drone_mesh.inprocess.radio import InProcessAir
from drone_mesh.lab import estimate as estimating
from drone_mesh.lab.estimate import EstimateError, estimate
from drone_mesh.lab.experiment import load_experiment
from drone_mesh.lab.plan import Plan
from drone_mesh.lab.worker import execute

PACKET_S = 1e-3  # what this processor needs for one packet; everything else costs nothing

SEVERAL_CELLS = """\
name: several
seed: 5
seeds: 3
base:
  layout: {kind: grid, drones: 9, spacing_m: 6}
  faults: [{at_s: 20, kill: {number: 1}}]
  duration_s: 60
sweep:
  layout.drones: [5, 16]
  routing: [child_table_tree, flooding]
"""


class PacketClock:
    """Processor time that only packets take."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.now_s = 0.0
        send = InProcessAir.send

        def counted(air: InProcessAir, payload: bytes) -> bool:
            self.now_s += PACKET_S
            return send(air, payload)

        monkeypatch.setattr(InProcessAir, "send", counted)
        monkeypatch.setattr(time, "process_time", lambda: self.now_s)


def plan_of(folder: Path, text: str) -> Plan:
    path = folder / "experiment.yaml"
    path.write_text(text, encoding="utf-8")
    return Plan(load_experiment(path))


def cost_s(plan: Plan, clock: PacketClock) -> float:
    """Of all its runs together."""
    before_s = clock.now_s
    for planned in plan:
        assert execute(planned.spec).failure == ""
    return clock.now_s - before_s


@pytest.mark.slow
@pytest.mark.parametrize("budget_s", [0.5, 4.0])
def test_the_estimate_is_within_30_percent_also_of_cells_that_differ(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, budget_s: float
) -> None:
    plan = plan_of(tmp_path, SEVERAL_CELLS)
    clock = PacketClock(monkeypatch)
    monkeypatch.setattr(estimating, "BUDGET_S", budget_s)
    guess = estimate(plan, 1)
    assert guess.run_s * len(plan) == pytest.approx(cost_s(plan, clock), rel=0.3)
    assert guess.wall_s > guess.run_s * len(plan)


def test_more_workers_take_less_time_and_none_do_not_have_to_start(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    plan = plan_of(tmp_path, SEVERAL_CELLS)
    monkeypatch.setattr(estimating, "_trial", lambda *_arguments: 1.0)
    alone, one, two = (estimate(plan, workers).wall_s for workers in (0, 1, 2))
    assert one - alone == pytest.approx(estimating.START_S)
    assert two - estimating.START_S == pytest.approx((one - estimating.START_S) / 2)


def test_every_cell_has_a_trial_even_without_any_time_for_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    plan = plan_of(tmp_path, SEVERAL_CELLS)
    clock = PacketClock(monkeypatch)
    monkeypatch.setattr(estimating, "BUDGET_S", 0.0)
    guess = estimate(plan, 1)
    assert guess.trials == len(plan.cells)
    assert clock.now_s < (len(plan.cells) + 1) * guess.run_s / 2


def test_a_cell_with_few_trials_weighs_as_much_as_the_others(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    costs = iter([9.0, 1.0, 1.0, 3.0, 3.0, 5.0])  # the first loads the code, and does not count

    def trial(_spec: object, _most_s: float) -> float:
        spent_s.append(next(costs))
        return spent_s[-1]

    spent_s: list[float] = []
    monkeypatch.setattr(estimating, "_trial", trial)
    monkeypatch.setattr(estimating, "BUDGET_S", 12.0)
    monkeypatch.setattr(time, "process_time", lambda: sum(spent_s))
    guess = estimate(plan_of(tmp_path, SEVERAL_CELLS), 1)
    assert guess.trials == 5
    assert guess.run_s == statistics.mean([statistics.mean([1.0, 5.0]), 1.0, 3.0, 3.0])


def test_a_trial_that_fails_is_an_error_that_says_why(tmp_path: Path) -> None:
    sparse = "uniform, drones: 50, mean_degree: 0.5"
    text = SEVERAL_CELLS.replace("grid, drones: 9, spacing_m: 6", sparse)
    text = text.replace("  layout.drones: [5, 16]\n", "")
    with pytest.raises(EstimateError, match="a trial run failed: .*draws was connected"):
        estimate(plan_of(tmp_path, text), 1)
