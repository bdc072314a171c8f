"""Reads a results folder for analysis."""

from __future__ import annotations

from pathlib import Path
from typing import Iterable, Mapping, NamedTuple, Sequence

from drone_mesh.errors import ConfigurationError
from drone_mesh.lab import extensions
from drone_mesh.lab.expectations import matching
from drone_mesh.lab.experiment import LoadedExperiment, load_experiment
from drone_mesh.lab.plan import CONTROL_FROM, Plan, PlannedRun
from drone_mesh.lab.store import (
    EXPERIMENT,
    StoreError,
    read_failures,
    read_provenance,
    read_runs,
)

CELLS_SHOWN = 4  # in an error
DEFAULT_METRICS = ("healed", "t_total_s", "uptime", "distance_total_m", "packets")

Row = Mapping[str, str]


class Results(NamedTuple):
    """All completed runs of an experiment's plan."""

    folder: Path
    loaded: LoadedExperiment
    plan: Sequence[PlannedRun]
    rows: Mapping[str, Row]  # by run id
    by_cell: Mapping[int, dict[int, Row]]  # the same, by cell and repetition
    controls: Mapping[int, dict[int, Row]]  # of a baseline on other seeds, by its cell
    failures: Sequence[Row]
    sessions: Sequence[Mapping[str, object]]

    @property
    def metrics(self) -> list[str]:
        wanted = self.loaded.experiment.metrics or DEFAULT_METRICS
        return list(map(extensions.column_of, wanted))

    def only(self, text: str, metrics: Sequence[str] = ()) -> Results:
        """The cells that match axis=value[,axis=value...], with these metrics if there are any.

        Raises ConfigurationError if none matches, or for an unknown metric.
        """
        self.check_columns(metrics)
        fit = self._matching(text)
        if not fit:
            raise ConfigurationError(f"{self.folder}: no cell matches {text}")
        experiment = self.loaded.experiment
        if metrics:
            experiment = experiment.model_copy(update={"metrics": list(metrics)})
        cells = [self.loaded.cells[index] for index in fit]
        return self._replace(
            loaded=self.loaded._replace(experiment=experiment, cells=cells),
            by_cell={place: self.drawn(index) for place, index in enumerate(fit)},
            controls={place: self.controls.get(index, {}) for place, index in enumerate(fit)},
        )

    def check_columns(self, metrics: Sequence[str]) -> None:
        """Raise ConfigurationError for a metric that runs.csv does not have."""
        columns = next(iter(self.rows.values()), {})
        for metric in metrics:
            if metric not in columns:
                raise ConfigurationError(f"{self.folder}: runs.csv has no column {metric}")

    def _matching(self, text: str) -> list[int]:
        return matching([cell.texts for cell in self.loaded.cells], text)

    def of_cell(self, cell: int) -> dict[int, Row]:
        """The rows of one cell that count in the report, by repetition.

        `draws:` may exclude split runs, or all others.
        """
        return self._counted(self.drawn(cell))

    def control(self, baseline: int, metric: str) -> tuple[list[float], list[float]]:
        """A metric of a baseline, and of as many runs of it on other seeds: an A/A comparison."""
        others = self._counted(self.controls.get(baseline, {}))
        return paired(self.of_cell(baseline).values(), others.values(), metric)

    def _counted(self, rows: Mapping[int, Row]) -> dict[int, Row]:
        draws = self.loaded.experiment.draws
        return {
            repetition: row
            for repetition, row in rows.items()
            if draws == "all" or (row.get("split") == "1") == (draws == "split")
        }

    def drawn(self, cell: int) -> dict[int, Row]:
        """All rows of one cell, by repetition."""
        return self.by_cell.get(cell, {})

    def codes(self, cell: int) -> list[str]:
        """The versions of the code of its runs. More than one: they are not the same experiment."""
        return sorted({row["code"] for row in self.drawn(cell).values()})

    def marked(self, cell: int, runs: int) -> str:
        """A number of runs of a cell in a table, marked if their code is not the same."""
        return f"{runs} (mixed code)" if len(self.codes(cell)) > 1 else str(runs)

    def pairs(self, a: int, b: int) -> tuple[list[Row], list[Row]]:
        """The rows of two cells for the seeds that both have, in the same order."""
        in_a, in_b = self.of_cell(a), self.of_cell(b)
        both = sorted(in_a.keys() & in_b)
        return [in_a[r] for r in both], [in_b[r] for r in both]

    @property
    def axis_names(self) -> dict[str, str]:
        """The names of axes in tables and figures: their last words if these are unique."""
        short = {axis: _last_words(axis) for axis in self.loaded.axes}
        if len(set(short.values())) < len(short):
            return {axis: axis for axis in short}
        return short

    def find_cell(self, text: str) -> int:
        """The one cell that matches axis=value[,axis=value...]. Raises ConfigurationError."""
        fit = self._matching(text)
        if len(fit) != 1:
            labels = [self.loaded.cells[i].label for i in fit or range(len(self.loaded.cells))]
            shown = "; ".join(labels[:CELLS_SHOWN]) + ("; ..." if labels[CELLS_SHOWN:] else "")
            what = (
                f"{len(fit)} cells match, expected one" if fit else "no cell matches; the cells are"
            )
            raise ConfigurationError(f"cell {text}: {what}: {shown}")
        return fit[0]

    def find_run(self, beginning: str) -> PlannedRun:
        """The one planned run with this prefix of its id. Raises ConfigurationError."""
        fit = [planned for planned in self.plan if planned.spec.run.startswith(beginning)]
        if len(fit) != 1:
            raise ConfigurationError(
                f"{self.folder}: {len(fit)} runs of the plan begin with {beginning}, expected one"
            )
        return fit[0]


def load_results(folder: Path) -> Results:
    """Read a folder written by `lab run`. Raises StoreError or ConfigurationError."""
    sessions = read_provenance(folder)
    if not sessions or not (folder / EXPERIMENT).exists():
        raise StoreError(f"{folder}: not a results folder of the lab")
    last = sessions[-1]
    loaded = load_experiment(folder / EXPERIMENT, list(last["overrides"]), Path(last["folder"]))
    rows = read_runs(folder)
    seeds = _seeds(loaded, rows)
    plan = list(Plan(loaded, seeds))
    by_cell: dict[int, dict[int, Row]] = {}
    controls: dict[int, dict[int, Row]] = {}
    for planned in plan:
        if planned.spec.run in rows:
            kind = controls if planned.is_control else by_cell
            kind.setdefault(planned.cell, {})[planned.spec.repetition] = rows[planned.spec.run]
    return Results(folder, loaded, plan, rows, by_cell, controls, read_failures(folder), sessions)


def number(row: Row, column: str) -> float | None:
    """A metric of a run; None if undefined."""
    text = row.get(column, "")
    return float(text) if text else None


def paired(a: Iterable[Row], b: Iterable[Row], metric: str) -> tuple[list[float], list[float]]:
    """A metric of these pairs of runs, where both have a value."""
    values = ((number(x, metric), number(y, metric)) for x, y in zip(a, b))
    whole = [(x, y) for x, y in values if x is not None and y is not None]
    return [x for x, _ in whole], [y for _, y in whole]


def _last_words(axis: str) -> str:
    words = axis.split(".")
    return ".".join(words[-2:] if words[0] == "faults" else words[-1:])


def _seeds(loaded: LoadedExperiment, rows: Mapping[str, Row]) -> int:
    """The number of repetitions, including those added by `stop:`."""
    repetitions = (int(row["repetition"]) for row in rows.values())
    most = max((one for one in repetitions if one < CONTROL_FROM), default=-1) + 1
    stop = loaded.experiment.stop
    if stop is None:
        return loaded.experiment.seeds
    return max(loaded.experiment.seeds, min(most, stop.max_seeds))
