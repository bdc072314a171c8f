"""An experiment file: read, overridden from the command line, and checked."""

from __future__ import annotations

import hashlib
import itertools
import json
from pathlib import Path
from typing import Any, NamedTuple, Sequence

from pydantic import ValidationError

from drone_mesh.errors import ConfigurationError
from drone_mesh.lab import extensions
from drone_mesh.lab.cells import TECHNIQUES, Cell, as_text, cells_of
from drone_mesh.lab.expectations import Expectation
from drone_mesh.lab.experiment_checks import NoSuchPlace, Source, nearest_name, put
from drone_mesh.lab.experiment_keys import Experiment
from drone_mesh.lab.metrics import METRICS
from drone_mesh.lab.metrics.registry import is_censored
from drone_mesh.yaml_file import KeyPath, read_mapping, read_value

MOST_CELLS = 10_000
MOST_RUNS = 10_000_000  # docs/lab.md: shards keep the memory small


class LoadedExperiment(NamedTuple):
    """An experiment that can be run."""

    experiment: Experiment
    cells: Sequence[Cell]
    path: Path
    folder: Path  # of the files and modules that it names
    overrides: tuple[str, ...]

    @property
    def axes(self) -> list[str]:
        """The names of all swept parameters, in the order of the file."""
        return list(self.cells[0].values) if self.cells else []

    @property
    def own_modules(self) -> list[str]:
        """The modules of techniques and metrics that are no part of this package."""
        names = [*(name for _kind, name in self._own_techniques), *self._own_metrics]
        return sorted({name.partition(":")[0] for name in names})

    def announce_own_code(self) -> None:
        """Print which of these modules a run is about to import, if there are any."""
        if self.own_modules:
            modules, folder = ", ".join(self.own_modules), self.folder.resolve()
            print(f"imports {modules}, installed or in {folder}: their code runs here", flush=True)

    def check_own_code(self) -> None:
        """Load these modules. Raises ConfigurationError for one without what the file names."""
        if not self.own_modules:
            return
        extensions.add_search_path(str(self.folder.resolve()))
        try:
            extensions.check_own(self._own_techniques, self._own_metrics)
        except ConfigurationError as error:
            raise ConfigurationError(f"{self.path}: {error}") from None

    @property
    def _own_techniques(self) -> list[tuple[str, str]]:
        found = {(kind, getattr(cell.scenario, kind)) for cell in self.cells for kind in TECHNIQUES}
        return sorted(one for one in found if extensions.is_own(one[1]))

    @property
    def _own_metrics(self) -> list[str]:
        stop = self.experiment.stop
        names = {*self.experiment.metrics, *([stop.metric] if stop else [])}
        return sorted(filter(extensions.is_own, names))

    @property
    def digest(self) -> str:
        """A hash of the file's content, independent of comments and the order of keys."""
        content = self.experiment.model_dump(mode="json")
        return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()[:16]


def load_experiment(
    path: Path, overrides: Sequence[str] = (), folder: Path | None = None
) -> LoadedExperiment:
    """Read and check the file. Raises ConfigurationError: file, line, key and what is wrong.

    Loads no code that it names: `LoadedExperiment.check_own_code` does.
    `folder`: the location of the files and modules that it names, if not beside it.
    """
    file = read_mapping(path, shares=True)
    content = file.content
    source = Source(file, folder or path.parent)
    if not content:
        raise source.error((), "expected 'key: value' lines")
    for override in overrides:
        _override(content, override, source)
    try:
        experiment = Experiment.model_validate(content)
    except ValidationError as error:
        raise source.error_of(error, (), Experiment) from None
    _check_metrics(experiment, source)
    cells = list(itertools.islice(cells_of(experiment, source), MOST_CELLS + 1))
    if len(cells) > MOST_CELLS:
        raise source.error(("sweep",), f"more than {MOST_CELLS} cells")
    seeds = max(experiment.seeds, experiment.stop.max_seeds if experiment.stop else 0)
    if len(cells) * seeds * (1 + experiment.control) > MOST_RUNS:
        raise source.error(
            ("seeds",), f"{len(cells)} cells x {seeds} seeds: more than {MOST_RUNS} runs"
        )
    if not cells:
        raise source.error(("where",), "where excludes every cell of the sweep")
    _check_compare(experiment, cells, source)
    _check_expectations(experiment, [] if overrides else cells, source)
    return LoadedExperiment(experiment, cells, path, source.folder, tuple(overrides))


def _override(content: dict[str, Any], override: str, source: Source) -> None:
    """Apply an override `a.b=c` to the content."""
    path, equals, text = override.partition("=")
    if not equals or not path:
        raise ConfigurationError(f"argument {override}: expected key=value, as in seeds=50")
    try:
        value = read_value(text)
    except ConfigurationError:
        raise ConfigurationError(f"argument {override}: the value is not valid YAML") from None
    head, _, rest = path.partition(".")
    if head not in Experiment.model_fields:
        hint = nearest_name(head, list(Experiment.model_fields))
        raise ConfigurationError(f"argument {override}: unknown key {head}; {hint}")
    if head == "sweep" and rest:
        content.setdefault("sweep", {})[rest] = value
        source.overrides[("sweep", rest)] = override
        return
    if head == "base" and rest in content.get("sweep", {}):
        raise ConfigurationError(
            f"argument {override}: {rest} is swept; use sweep.{rest}=[{text}] instead"
        )
    try:
        place = put(content, path, value)
    except NoSuchPlace as error:
        raise ConfigurationError(f"argument {override}: {error}") from None
    source.overrides[place] = override


def _check_metrics(experiment: Experiment, source: Source) -> None:
    wanted: list[tuple[KeyPath, str]] = [
        (("metrics", index), name) for index, name in enumerate(experiment.metrics)
    ]
    if experiment.stop is not None:
        wanted.append((("stop", "metric"), experiment.stop.metric))
    columns: dict[str, str] = {}
    for place, name in wanted:
        try:
            extensions.check_metric(name)
        except ConfigurationError as error:
            raise source.error(place, str(error)) from None
        column = extensions.column_of(name)
        if columns.setdefault(column, name) != name or (":" in name and column in METRICS):
            raise source.error(place, f"metric {name}: another one is also called {column}")
    if experiment.stop is not None and (
        (experiment.stop.half_width is None) == (experiment.stop.relative_half_width is None)
    ):
        raise source.error(("stop",), "stop: give either half_width or relative_half_width")


def _check_compare(experiment: Experiment, cells: Sequence[Cell], source: Source) -> None:
    compare = experiment.compare
    if compare is None:
        if experiment.control:
            raise source.error(("control",), "control: give the baseline, with compare")
        return
    axes = list(cells[0].values)
    if compare.over not in axes:
        raise source.error(
            ("compare", "over"),
            f"compare.over: no axis {compare.over}; {nearest_name(compare.over, axes)}",
        )
    values = [cell.values[compare.over] for cell in cells]
    if compare.baseline not in values:
        raise source.error(
            ("compare", "baseline"),
            f"compare.baseline: {compare.baseline!r} is not a value of {compare.over}; "
            f"give one that is, as in compare.baseline={as_text(values[0])}",
        )


def _check_expectations(experiment: Experiment, cells: Sequence[Cell], source: Source) -> None:
    """`cells`: those that they may speak of; empty if it is an override that took some away."""
    own = {extensions.column_of(name) for name in experiment.metrics}
    for index, text in enumerate(experiment.expect):
        try:
            expectation = Expectation.parse(text)
            if expectation.metric not in own:
                extensions.check_metric(expectation.metric)
            if is_censored(expectation.metric):
                raise ConfigurationError(
                    f"{expectation.metric} leaves out runs that did not heal: use healed, or "
                    "t_capped_s"
                )
            if cells:
                expectation.cells([cell.texts for cell in cells])
        except ConfigurationError as error:
            raise source.error(("expect", index), f"expect: {error}") from None
