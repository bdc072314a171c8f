"""The cells of an experiment: its sweep, expanded into scenarios."""

from __future__ import annotations

import copy
import functools
import itertools
import json
import math
from pathlib import Path
from typing import Any, Iterator, Mapping, NamedTuple

from pydantic import ValidationError

from drone_mesh import fence_file
from drone_mesh.air import obstacle_file
from drone_mesh.drone.geodesy import Origin
from drone_mesh.errors import ConfigurationError
from drone_mesh.lab import extensions, formations, places
from drone_mesh.lab.experiment_checks import NoSuchPlace, Source, check_scenario, put
from drone_mesh.lab.experiment_keys import Experiment
from drone_mesh.lab.expression import ExpressionError, Where
from drone_mesh.lab.scenario import Scenario
from drone_mesh.yaml_file import KeyPath

MOST_COMBINATIONS = 1_000_000  # of the axes, before `where`
TECHNIQUES = ("routing", "repair")


class Cell(NamedTuple):
    """One point of the sweep."""

    values: Mapping[str, Any]  # axis -> value
    scenario: Scenario

    @property
    def texts(self) -> dict[str, str]:
        return {axis: as_text(value) for axis, value in self.values.items()}

    @property
    def label(self) -> str:
        """The label for display and tables; empty without a sweep."""
        return " ".join(f"{axis}={value}" for axis, value in self.texts.items())


def as_text(value: Any) -> str:
    """A swept value as text for tables and file names."""
    if isinstance(value, (str, int, float, bool)) or value is None:
        return str(value)
    if isinstance(value, dict):
        return ";".join(f"{key}:{as_text(inside)}" for key, inside in value.items()) or "none"
    return json.dumps(value, sort_keys=True, separators=(",", ":"))


def cells_of(experiment: Experiment, source: Source) -> Iterator[Cell]:
    """Each point of the sweep that `where` leaves. Raises ConfigurationError, as for the file."""
    axes: list[list[dict[str, Any]]] = []
    named: dict[str, KeyPath] = {}
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
    placed: dict[KeyPath, str] = {}
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
    for key in TECHNIQUES:
        try:
            extensions.check_technique(key, getattr(scenario, key), scenario.model)
        except ConfigurationError as error:
            raise source.error(named.get(key, ("base", key)), f"{key}: {error}") from None
    check_scenario(scenario, source)
    return scenario


def _read_files(content: dict[str, Any], source: Source) -> None:
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


def _areas(content: dict[str, Any], path: Path) -> list[fence_file.Row]:
    origin = content["fence"].get("origin")
    return fence_file.rows_of_file(path, None if origin is None else Origin.parse(str(origin)))
