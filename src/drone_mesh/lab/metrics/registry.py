"""All metrics by name, and the decorator that registers them."""

from __future__ import annotations

import functools
import math
from typing import Callable, Iterable, NamedTuple, Sequence

from drone_mesh.lab.record import RunRecord

NAN = math.nan
Measure = Callable[[RunRecord], float]
Several = Callable[[RunRecord], Sequence[float]]


class Metric(NamedTuple):
    """One column of runs.csv."""

    unit: str
    definition: str
    measure: Measure  # NaN: undefined for this run, an empty cell
    better: str = ""  # "less", "more" or neither
    censored: bool = False  # a time that is empty if the event did not happen
    family: str = ""  # in lists, one entry stands for all metrics of this name


METRICS: dict[str, Metric] = {}  # in the order of the columns


def listed() -> dict[str, Metric]:
    """The metrics for a list, by name; those of a family appear once, under its name."""
    return {metric.family or name: metric for name, metric in METRICS.items()}


def is_share(column: str) -> bool:
    """Whether this column is a metric for which every run yields 0 or 1."""
    return column in METRICS and METRICS[column].unit == "0/1"


def is_censored(column: str) -> bool:
    """Whether this column is a metric that is empty if its event did not happen."""
    return column in METRICS and METRICS[column].censored


def unit_of(column: str) -> str:
    """The unit of a column; empty if it has none, or its name says it."""
    unit = METRICS[column].unit if column in METRICS else ""
    return "" if unit in ("0/1", column) or column.endswith(f"_{unit}") else unit


def measure_all(record: RunRecord) -> dict[str, float]:
    return {name: float(metric.measure(record)) for name, metric in METRICS.items()}


def ratio(part: float, whole: float) -> float:
    """NaN if there is no whole."""
    return part / whole if whole else NAN


def mean(values: Iterable[float]) -> float:
    """NaN if there are no values."""
    found = list(values)
    return ratio(sum(found), len(found))


def percentiles(values: Sequence[float], *shares: float) -> list[float]:
    """The percentiles of the values at these shares; NaN without values."""
    ordered = sorted(values) or [NAN]
    return [ordered[max(0, math.ceil(share * len(ordered)) - 1)] for share in shares]


def per_drone_and_s(record: RunRecord, count: float) -> float:
    return count / record.end_s / len(record.start.places)


def metric(unit: str, definition: str, **about: object) -> Callable[[Measure], Measure]:
    """Register the decorated function as a metric under its name; `about`: fields of Metric."""

    def note(measure: Measure) -> Measure:
        METRICS[measure.__name__] = Metric(unit, definition, measure, **about)  # type: ignore[arg-type]
        return measure

    return note


less = functools.partial(metric, better="less")
more = functools.partial(metric, better="more")


def metrics(unit: str, better: str = "", **definitions: str) -> Callable[[Several], Several]:
    """Register several metrics, by name: the decorated function measures them, in this order."""

    def note(measure: Several) -> Several:
        def only(place: int) -> Measure:
            return lambda run: measure(run)[place]

        for place, (name, definition) in enumerate(definitions.items()):
            METRICS[name] = Metric(unit, definition, only(place), better)
        return measure

    return note
