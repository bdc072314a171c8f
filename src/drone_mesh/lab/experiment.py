"""An experiment file: read, overridden from the command line, checked, expanded; or begun."""

import copy
import functools
import hashlib
import itertools
import json
import math
import re
from pathlib import Path
from typing import Any, Dict, Iterator, List, Mapping, NamedTuple, Optional, Sequence, Tuple

from pydantic import BaseModel, ConfigDict, Field, ValidationError
from typing_extensions import Annotated, Literal

from drone_mesh import fence_file
from drone_mesh.air import obstacle_file
from drone_mesh.drone.geodesy import Origin
from drone_mesh.errors import ConfigurationError
from drone_mesh.lab import extensions, formations, places
from drone_mesh.lab.expectations import Expectation
from drone_mesh.lab.experiment_checks import NoSuchPlace, Source, check_scenario, nearest_name, put
from drone_mesh.lab.expression import ExpressionError, Where
from drone_mesh.lab.metrics import METRICS
from drone_mesh.lab.metrics.registry import is_censored
from drone_mesh.lab.scenario import Scenario
from drone_mesh.lab.scenario_parts import Part
from drone_mesh.lab.terminal import PROGRAM
from drone_mesh.yaml_file import KeyPath, read_mapping, read_value

MOST_CELLS = 10_000
MOST_COMBINATIONS = 1_000_000  # of the axes, before `where`
MOST_RUNS = 10_000_000  # docs/lab.md: shards keep the memory small

TEMPLATE = Path(__file__).resolve().parent / "experiment.template.yaml"

_TECHNIQUES = ("routing", "repair")
NAME_PATTERN = r"^[A-Za-z0-9_][A-Za-z0-9_.-]*$"  # used as the name of a folder


class Stop(Part):
    """Add seeds until the confidence interval of a metric is narrow enough in every cell."""

    metric: str
    half_width: Optional[Annotated[float, Field(gt=0)]] = None
    relative_half_width: Optional[Annotated[float, Field(gt=0)]] = None
    max_seeds: Annotated[int, Field(ge=1, le=1_000_000)] = 400


class Compare(Part):
    """The paired comparison of the report: each value of an axis against its baseline."""

    over: str  # an axis of the sweep
    baseline: Any


class Experiment(BaseModel):
    """The whole file, before its cells are expanded."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)

    name: Annotated[str, Field(pattern=NAME_PATTERN)]
    title: str = ""  # of the report
    seed: Annotated[int, Field(ge=0)] = 1  # of everything random in the experiment
    seeds: Annotated[int, Field(ge=1, le=1_000_000)] = 10  # repetitions of each cell
    base: Dict[str, Any] = {}  # a Scenario; checked once per cell
    sweep: Dict[str, List[Any]] = {}
    zip: List[Dict[str, List[Any]]] = []
    where: Optional[str] = None
    stop: Optional[Stop] = None
    metrics: List[str] = []
    compare: Optional[Compare] = None
    control: bool = False  # run the baseline of `compare` on other seeds, too
    expect: List[str] = []
    draws: Literal["all", "split", "whole"] = "all"  # which runs the report counts
    timeout_s: Annotated[float, Field(gt=0)] = 600.0  # wall time of one run


class Cell(NamedTuple):
    """One point of the sweep."""

    values: Mapping[str, Any]  # axis -> value
    scenario: Scenario

    @property
    def texts(self) -> Dict[str, str]:
        return {axis: as_text(value) for axis, value in self.values.items()}

    @property
    def label(self) -> str:
        """The label for display and tables; empty without a sweep."""
        return " ".join(f"{axis}={value}" for axis, value in self.texts.items())


class LoadedExperiment(NamedTuple):
    """An experiment that can be run."""

    experiment: Experiment
    cells: Sequence[Cell]
    path: Path
    folder: Path  # of the files and modules that it names
    overrides: Tuple[str, ...]

    @property
    def axes(self) -> List[str]:
        """The names of all swept parameters, in the order of the file."""
        return list(self.cells[0].values) if self.cells else []

    @property
    def own_modules(self) -> List[str]:
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
    def _own_techniques(self) -> List[Tuple[str, str]]:
        found = {
            (kind, getattr(cell.scenario, kind)) for cell in self.cells for kind in _TECHNIQUES
        }
        return sorted(one for one in found if extensions.is_own(one[1]))

    @property
    def _own_metrics(self) -> List[str]:
        stop = self.experiment.stop
        names = {*self.experiment.metrics, *([stop.metric] if stop else [])}
        return sorted(filter(extensions.is_own, names))

    @property
    def digest(self) -> str:
        """A hash of the file's content, independent of comments and the order of keys."""
        content = self.experiment.model_dump(mode="json")
        return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()[:16]


def load_experiment(
    path: Path, overrides: Sequence[str] = (), folder: Optional[Path] = None
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
    cells = list(itertools.islice(_cells(experiment, source), MOST_CELLS + 1))
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


def as_text(value: Any) -> str:
    """A swept value as text for tables and file names."""
    if isinstance(value, (str, int, float, bool)) or value is None:
        return str(value)
    if isinstance(value, dict):
        return ";".join(f"{key}:{as_text(inside)}" for key, inside in value.items()) or "none"
    return json.dumps(value, sort_keys=True, separators=(",", ":"))


def _override(content: Dict[str, Any], override: str, source: Source) -> None:
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


def _cells(experiment: Experiment, source: Source) -> Iterator[Cell]:
    axes: List[List[Dict[str, Any]]] = []
    named: Dict[str, KeyPath] = {}
    for axis, values in experiment.sweep.items():
        named[axis] = ("sweep", axis)
        if not values:
            raise source.error(("sweep", axis), f"sweep.{axis}: no values")
        axes.append([{axis: value} for value in values])
    for number, group in enumerate(experiment.zip):
        lengths = {axis: len(values) for axis, values in group.items()}
        if len(set(lengths.values())) != 1 or 0 in lengths.values():
            raise source.error(
                ("zip", number), f"zip: the lists must have the same length, not {lengths}"
            )
        for axis in group:
            if axis in named:
                raise source.error(("zip", number, axis), f"{axis} is swept twice")
            named[axis] = ("zip", number, axis)
        axes.append([dict(zip(group, row)) for row in zip(*group.values())])
    where = None
    if experiment.where is not None:
        try:
            where = Where(experiment.where, list(named))
        except ExpressionError as error:
            raise source.error(("where",), f"where: {error}") from None
    if math.prod(map(len, axes)) > MOST_COMBINATIONS:
        raise source.error(("sweep",), f"more than {MOST_COMBINATIONS} combinations of the axes")
    for combination in itertools.product(*axes):
        point = {axis: value for part in combination for axis, value in part.items()}
        try:
            is_wanted = where is None or where.holds(point)
        except ExpressionError as error:
            raise source.error(("where",), f"where: {error}") from None
        if is_wanted:
            yield Cell(point, _scenario(experiment, point, named, source))


def _scenario(
    experiment: Experiment, values: Mapping[str, Any], named: Mapping[str, KeyPath], source: Source
) -> Scenario:
    content = json.loads(json.dumps(experiment.base))
    placed: Dict[KeyPath, str] = {}
    for axis, value in values.items():
        try:
            placed[put(content, axis, copy.deepcopy(value))] = axis
        except NoSuchPlace as error:
            raise source.error(named[axis], f"axis {axis}: {error}") from None
    _read_files(content, source)
    try:
        scenario = Scenario.model_validate(content)
    except ValidationError as error:
        inside = tuple(error.errors()[0]["loc"])
        for place, axis in placed.items():
            if inside[: len(place)] == place:
                raise source.error_of(error, (), Scenario, shown=named[axis]) from None
        raise source.error_of(error, ("base",), Scenario) from None
    for key in _TECHNIQUES:
        try:
            extensions.check_technique(key, getattr(scenario, key), scenario.model)
        except ConfigurationError as error:
            raise source.error(named.get(key, ("base", key)), f"{key}: {error}") from None
    check_scenario(scenario, source)
    return scenario


def _read_files(content: Dict[str, Any], source: Source) -> None:
    """Read other files into the scenario, because its id must depend on their content, not path."""
    for part, key, read in (
        ("layout", "places", places.rows_of_file),
        ("obstacles", "boxes", obstacle_file.rows_of_file),
        ("fence", "areas", functools.partial(_areas, content)),
        ("mobility", "knots", formations.rows_of_file),
    ):
        holder = content.get(part)
        if not isinstance(holder, dict) or not isinstance(holder.get("path"), str):
            continue
        try:
            holder[key] = read(source.folder / holder["path"])
        except ConfigurationError as error:
            raise source.error(("base", part, "path"), f"{part}.path: {error}") from None


def _areas(content: Dict[str, Any], path: Path) -> List[fence_file.Row]:
    origin = content["fence"].get("origin")
    return fence_file.rows_of_file(path, None if origin is None else Origin.parse(str(origin)))


def _check_metrics(experiment: Experiment, source: Source) -> None:
    wanted: List[Tuple[KeyPath, str]] = [
        (("metrics", index), name) for index, name in enumerate(experiment.metrics)
    ]
    if experiment.stop is not None:
        wanted.append((("stop", "metric"), experiment.stop.metric))
    columns: Dict[str, str] = {}
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


def write_template(name: str) -> Path:
    """Write NAME.yaml into the current folder. Raises ConfigurationError if it cannot."""
    if not re.match(NAME_PATTERN, name):
        raise ConfigurationError(f"{name!r}: use letters, digits, dot, dash and underscore")
    path = Path(f"{name}.yaml")
    try:
        with path.open("x", encoding="utf-8") as file:
            text = TEMPLATE.read_text(encoding="utf-8")
            file.write(text.format(name=name, file=path, program=PROGRAM))
    except FileExistsError:
        raise ConfigurationError(f"{path} already exists; it was not changed") from None
    except OSError as error:
        raise ConfigurationError(f"{path}: {error.strerror}") from error
    return path
