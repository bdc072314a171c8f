"""Runs the missing runs of an experiment until it is complete, and merges shards."""

from __future__ import annotations

import math
import shlex
from pathlib import Path
from typing import Iterator, Mapping, Sequence

from drone_mesh.lab.engine import run_all
from drone_mesh.lab.experiment import LoadedExperiment, load_experiment
from drone_mesh.lab.extensions import column_of
from drone_mesh.lab.plan import Plan, PlannedRun
from drone_mesh.lab.provenance import code_with, describe_session
from drone_mesh.lab.store import (
    EXPERIMENT,
    PROVENANCE,
    Store,
    StoreError,
    read_provenance,
    read_runs,
)
from drone_mesh.lab.terminal import PROGRAM, Progress


class OlderCodeError(StoreError):
    """New runs would be in one cell with runs of older code."""


class Campaign:
    """One experiment and its results folder."""

    def __init__(self, loaded: LoadedExperiment, folder: Path, command: Sequence[str]) -> None:
        """`command`: the command line, for provenance and for resuming."""
        self.loaded = loaded
        self.folder = folder
        self._command = list(command)
        self.failures = 0  # of the runs of this session
        self.first_failure = ""  # its message
        self.completed = 0

    def run(
        self,
        workers: int,
        cluster: str | None,
        shard: tuple[int, int] | None = None,
        retry_failed: bool = False,
        again: bool = False,
    ) -> None:
        """Execute missing runs; add seeds if the experiment requests it.

        `again`: those of older code count as missing. Otherwise raises OlderCodeError rather than
        mix them with others in a cell.

        Loads the modules that the experiment names. Raises ConfigurationError for one that fails,
        StoreError or EngineError; completed runs are kept, in order.
        """
        if shard is not None and self.loaded.experiment.stop is not None:
            raise StoreError(
                "--shard: `stop` needs the runs of all shards: give seeds=N stop=null instead"
            )
        self.loaded.check_own_code()
        plan = Plan(self.loaded)
        store = Store(self.folder, plan)
        try:
            if retry_failed:
                store.forget_failures()
            name = cluster or ("in this process" if workers == 0 else f"{workers} local")
            if again:
                store.forget(_older(plan, store))
            store.describe([describe_session(self._command, self.loaded, name)])
            part, parts = shard or (0, 1)
            while True:
                missing = {
                    planned.spec.run: planned
                    for place, planned in enumerate(plan)
                    if planned.spec.run not in store.codes and planned.spec.run not in store.failed
                    if place % parts == part
                }
                self._run_missing(missing, plan, store, workers, cluster)
                more = self._more_seeds(plan)
                if more is None:
                    break
                plan = Plan(self.loaded, more)
                store.use(plan)
        finally:
            try:
                store.export()
            finally:
                store.close()

    def _run_missing(
        self,
        missing: Mapping[str, PlannedRun],
        plan: Plan,
        store: Store,
        workers: int,
        cluster: str | None,
    ) -> None:
        self._check_code(plan, store, missing)
        if not missing:
            return
        progress = Progress(len(missing))
        specs = (planned.spec for planned in missing.values())
        show = f"{PROGRAM} show {shlex.quote(str(self.folder))}"  # repeats one run
        outcomes = run_all(specs, min(workers, len(missing)), cluster)
        try:
            for outcome in outcomes:
                planned = missing[outcome.spec.run]
                label = plan.cells[planned.cell].label
                store.add(outcome, label, f"{show} {outcome.spec.run}")
                progress.count(bool(outcome.failure))
                self.completed += 1
                self.failures += bool(outcome.failure)
                self.first_failure = self.first_failure or outcome.message
        finally:
            outcomes.close()  # type: ignore[attr-defined]
            progress.close()

    def _check_code(self, plan: Plan, store: Store, missing: Mapping[str, PlannedRun]) -> None:
        older = _older(plan, store)
        if not older:
            return
        words = {word for run, code in older.items() for word in _changed(store.codes[run], code)}
        text = f"{len(older)} runs are of an older {', '.join(sorted(words))}"
        cells = {one.cell for one in missing.values()}
        if any(one.cell in cells and one.spec.run in older for one in plan):
            raise OlderCodeError(
                f"{self.folder}: {text}: `--again` repeats them, another --out keeps them"
            )
        print(f"{text}: `--again` repeats them", flush=True)

    def _more_seeds(self, plan: Plan) -> int | None:
        """The number of seeds for each cell in the next round; None: enough."""
        stop = self.loaded.experiment.stop
        if stop is None or plan.seeds >= stop.max_seeds:
            return None
        cell_of = {one.spec.run: one.cell for one in plan if not one.is_control}
        values: dict[int, list[float]] = {cell: [] for cell in range(len(plan.cells))}
        column = column_of(stop.metric)
        for run, row in read_runs(self.folder).items():
            if run in cell_of and row[column]:
                values[cell_of[run]].append(float(row[column]))
        for found in values.values():
            if not _is_narrow(found, stop.half_width, stop.relative_half_width):
                return min(stop.max_seeds, plan.seeds + self.loaded.experiment.seeds)
        return None


def _older(plan: Plan, store: Store) -> dict[str, str]:
    """The finished runs of the plan that are not of this code, and the code that is."""
    now = {
        one.spec.run: code_with(one.spec.own_code) for one in plan if one.spec.run in store.codes
    }
    return {run: code for run, code in now.items() if store.codes[run] != code}


def _changed(old: str, new: str) -> Iterator[str]:
    """Yield what differs between two versions of the code: modules of the user, or this package."""
    for word in set(new.split()) - set(old.split()):
        module, colon, _ = word.partition(":")
        yield f"{module}.py" if colon else "drone_mesh"


def _is_narrow(
    values: Sequence[float], half_width: float | None, relative_half_width: float | None
) -> bool:
    """Whether the normal 95 % interval of the mean is narrow enough."""
    if len(values) < 2:
        return False
    mean = sum(values) / len(values)  # of metrics that may be infinite: statistics raises for these
    variance = sum((value - mean) ** 2 for value in values) / (len(values) - 1)
    half = 1.96 * math.sqrt(variance / len(values))
    if half_width is not None:
        return half <= half_width
    assert relative_half_width is not None
    return half <= relative_half_width * abs(mean)


def merge(into: Path, shards: Sequence[Path]) -> int:
    """Add all new rows of the shards; returns the number of runs added.

    Raises StoreError for shards of different experiments, or one run of different code.
    """
    sessions = [read_provenance(shard) for shard in shards]
    for shard, found in zip(shards, sessions):
        if not found:
            raise StoreError(f"{shard}: no {PROVENANCE} there, so it is not a results folder")
    digests = {found[-1]["experiment_hash"] for found in sessions}
    if len(digests) > 1:
        raise StoreError("these shards belong to different experiments: their files differ")
    overrides = list(sessions[0][-1].get("overrides", ()))
    folder = Path(sessions[0][-1]["folder"])
    plan = Plan(load_experiment(shards[0] / EXPERIMENT, overrides, folder))
    store = Store(into, plan)
    try:
        added = store.take_from(shards)
        store.describe([one for found in sessions for one in found])
        store.export()
    finally:
        store.close()
    return added
