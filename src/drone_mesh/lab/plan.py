"""The plan of an experiment: every run with its id, in the order of the results."""

from __future__ import annotations

import hashlib
import json
from typing import Any, Iterator, NamedTuple, Sequence

from drone_mesh.lab.cells import Cell, as_text
from drone_mesh.lab.experiment import LoadedExperiment
from drone_mesh.lab.provenance import own_code
from drone_mesh.lab.scenario import Scenario

LONGEST_VALUE = 200  # characters in one field of runs.csv; longer values become a hash
CONTROL_FROM = 1_000_000  # the repetition of the first control run: above all seeds of the cells
SCHEMA = 1  # of runs.csv; a new number makes every run a new one


class RunSpec(NamedTuple):
    """One run, in a form that can be sent to a worker."""

    run: str  # id
    scenario: str  # JSON
    seed: int  # of the experiment
    repetition: int
    own_metrics: tuple[str, ...]
    search_path: str  # folder of the user's modules; empty: none
    own_code: str  # of these modules, as `own_code` returns it
    timeout_s: float


class PlannedRun(NamedTuple):
    """One run and its cell."""

    spec: RunSpec
    cell: int

    @property
    def is_control(self) -> bool:
        """Whether it repeats its cell, a baseline, on other seeds."""
        return self.spec.repetition >= CONTROL_FROM


class Plan:
    """All runs of an experiment: every cell with one seed, then every cell with the next seed."""

    def __init__(self, loaded: LoadedExperiment, seeds: int | None = None) -> None:
        self.loaded = loaded
        self.cells: Sequence[Cell] = loaded.cells
        self.seeds = loaded.experiment.seeds if seeds is None else seeds
        self.own_metrics = tuple(name for name in loaded.experiment.metrics if ":" in name)
        self._hashes: dict[tuple[str, ...], str] = {}
        self._texts = [
            json.dumps(cell.scenario.model_dump(mode="json", exclude_none=True))
            for cell in self.cells
        ]
        compare = loaded.experiment.compare if loaded.experiment.control else None
        baselines = [
            compare and cell.values[compare.over] == compare.baseline for cell in self.cells
        ]
        self.controls = [index for index, is_baseline in enumerate(baselines) if is_baseline]
        self._folder = str(loaded.folder.resolve()) if loaded.own_modules else ""
        self._own_code = [self._code_of(cell.scenario) for cell in self.cells]
        # The values that differ from the defaults. Therefore a parameter added in a later version
        # does not change old run ids; a changed default requires a new SCHEMA.
        self._identities = [
            cell.scenario.model_dump(mode="json", exclude_none=True, exclude_defaults=True)
            for cell in self.cells
        ]

    def _code_of(self, scenario: Scenario) -> str:
        names = (scenario.routing, scenario.repair, *self.own_metrics)
        modules = sorted({name.partition(":")[0] for name in names if ":" in name})
        if tuple(modules) not in self._hashes:
            self._hashes[tuple(modules)] = own_code(modules, self._folder)
        return self._hashes[tuple(modules)]

    def __len__(self) -> int:
        return (len(self.cells) + len(self.controls)) * self.seeds

    def __iter__(self) -> Iterator[PlannedRun]:
        for repetition in range(self.seeds):
            for cell in range(len(self.cells)):
                yield self._run(cell, repetition)
            for cell in self.controls:
                yield self._run(cell, CONTROL_FROM + repetition)

    def _run(self, cell: int, repetition: int) -> PlannedRun:
        experiment = self.loaded.experiment
        spec = RunSpec(
            run_id(self._identities[cell], experiment.seed, repetition, self.own_metrics),
            self._texts[cell], experiment.seed, repetition, self.own_metrics,
            self._folder, self._own_code[cell], experiment.timeout_s,
        )  # fmt: skip
        return PlannedRun(spec, cell)

    def row(self, planned: PlannedRun) -> dict[str, str]:
        """A run of the plan in plan.csv."""
        names = {"run": planned.spec.run, "repetition": str(planned.spec.repetition)}
        values = self.cells[planned.cell].values
        return {**names, **{axis: as_text(value) for axis, value in values.items()}}

    @property
    def parameter_columns(self) -> list[str]:
        """All parameters of any cell, flattened, in order of first appearance."""
        columns: dict[str, None] = {}
        for text in self._texts:
            columns.update(dict.fromkeys(flatten(json.loads(text))))
        return list(columns)


def run_id(what: Any, seed: int, repetition: int, own_metrics: Sequence[str]) -> str:
    """A run's id from its content: its parameters, seed and metrics, not its time."""
    text = json.dumps([SCHEMA, what, seed, repetition, list(own_metrics)], sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def flatten(content: Any, before: str = "") -> dict[str, str]:
    """Every leaf of nested mappings, by its dotted path; the list of faults by index."""
    if isinstance(content, dict) and content:
        items = [(str(key), value) for key, value in content.items()]
    elif isinstance(content, list) and content and all(isinstance(v, dict) for v in content):
        items = [(str(index), value) for index, value in enumerate(content)]
    else:
        text = as_text(content)
        if len(text) > LONGEST_VALUE:
            text = f"sha256:{hashlib.sha256(text.encode()).hexdigest()[:16]}"
        return {before: text}
    flat: dict[str, str] = {}
    for key, value in items:
        flat.update(flatten(value, f"{before}.{key}" if before else key))
    return flat
