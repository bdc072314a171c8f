"""Judges the expectations of an experiment on its results, and writes them for a CI server."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Iterator, NamedTuple, Sequence
from xml.etree import ElementTree

from drone_mesh.errors import ConfigurationError
from drone_mesh.lab.expectations import Expectation
from drone_mesh.lab.metrics.registry import is_share
from drone_mesh.lab.results import Results, paired
from drone_mesh.lab.statistics import Interval, paired_difference, share_interval
from drone_mesh.lab.tables import summary_of
from drone_mesh.lab.terminal import as_duration

MET, NOT_MET, UNDECIDED = "met", "not met", "not decided"
MOST_RUNS = 10_000  # that are proposed to decide something
_STEP = 1.05  # by which the number of runs grows in the search for it


class Verdict(NamedTuple):
    """An expectation of one cell, or of one cell against another."""

    expectation: Expectation
    cell: str  # its label; empty: the only one
    outcome: str
    reason: str  # the interval, or why there is none
    wall_s: float = 0.0  # of the runs behind it

    @property
    def name(self) -> str:
        """The expectation with its cell."""
        return f"{self.expectation.text} [{self.cell}]" if self.cell else self.expectation.text


def judge(results: Results) -> list[Verdict]:
    """Judge all expectations. Raises ConfigurationError if there are none."""
    experiment = results.loaded.experiment
    if not experiment.expect:
        raise ConfigurationError(f"{results.folder}: the experiment has no `expect:`")
    return [
        verdict
        for text in experiment.expect
        for verdict in _judge(results, Expectation.parse(text))
    ]


def _judge(results: Results, expectation: Expectation) -> Iterator[Verdict]:
    cells = results.loaded.cells
    try:
        pairs = expectation.cells([cell.texts for cell in cells])
    except ConfigurationError:  # an override has taken them out of the sweep
        yield Verdict(expectation, "", UNDECIDED, "the experiment has no such cells now")
        return
    for index, other in pairs:
        compared = [index] if other is None else [index, other]
        wall_s = sum(
            float(row["wall_s"]) for one in compared for row in results.drawn(one).values()
        )
        outcome, reason = UNDECIDED, _unfit(results, compared)
        if not reason:
            interval, n = _interval(results, expectation, compared)
            outcome = outcome_of(interval, expectation)
            reason = f"{interval}, {n} {'runs' if other is None else 'seeds'}"
            if outcome == UNDECIDED:
                reason += f"; {_remedy(results, expectation, compared, interval, wall_s)}"
        yield Verdict(expectation, cells[index].label, outcome, reason, wall_s)


def _unfit(results: Results, cells: Sequence[int]) -> str:
    """Why these cells cannot be judged; empty: they can."""
    missing = sum(one.cell in cells and one.spec.run not in results.rows for one in results.plan)
    if missing:
        return f"{missing} runs are missing or failed"
    codes = {code.partition(" ")[0] for cell in cells for code in results.codes(cell)}
    if len(codes) > 1 or any(len(results.codes(cell)) > 1 for cell in cells):
        return "the runs are of different code"
    return ""


def _interval(
    results: Results, expectation: Expectation, cells: Sequence[int]
) -> tuple[Interval, int]:
    """Of the metric, or of the difference to the other cell; and the number of values behind it."""
    metric = expectation.metric
    if len(cells) == 1:
        interval = summary_of(results.of_cell(cells[0]), metric)
        return interval, interval.n
    ours, others = paired(*results.pairs(*cells), metric)
    interval = paired_difference(others, ours).difference
    if is_share(metric) and interval.low == interval.high:  # resampling finds no other value
        rare = share_interval(0, interval.n).high
        low, high = max(-1.0, interval.low - rare), min(1.0, interval.high + rare)
        interval = interval._replace(low=low, high=high)
    return interval, interval.n


def outcome_of(interval: Interval, expectation: Expectation) -> str:
    """MET if the whole interval is on the wanted side of the bound, NOT_MET if none of it is."""
    low, high, bound = interval.low, interval.high, expectation.bound
    if math.isnan(low):
        return UNDECIDED
    if expectation.relation[0] == "<":
        low, high, bound = -high, -low, -bound
    strictly = "=" not in expectation.relation
    if low > bound or (low == bound and not strictly):
        return MET
    return NOT_MET if high < bound or (high == bound and strictly) else UNDECIDED


def _remedy(
    results: Results,
    expectation: Expectation,
    cells: Sequence[int],
    interval: Interval,
    wall_s: float,
) -> str:
    """How many seeds would decide it, if the mean stays where it is."""
    n, by_wilson = interval.n, is_share(expectation.metric) and len(cells) == 1
    while n and n < MOST_RUNS and not math.isnan(interval.low):
        n = math.ceil(n * _STEP)
        if by_wilson:
            guess = share_interval(round(interval.value * n), n)
        else:
            shrunk = math.sqrt(interval.n / n)
            low, high = (
                interval.value + (end - interval.value) * shrunk
                for end in (interval.low, interval.high)
            )
            guess = Interval(interval.value, low, high, n)
        if outcome_of(guess, expectation) != UNDECIDED:
            seeds = max(map(len, map(results.drawn, cells)))
            needed = math.ceil(seeds * n / interval.n)  # of some draws nothing counts
            more_s = wall_s * (needed - seeds) / seeds
            return f"about {needed} seeds would decide it ({as_duration(more_s)} of one core more)"
    return "too few runs count" if math.isnan(interval.low) else f"not even {MOST_RUNS} runs would"


def write_junit(results: Results, verdicts: Sequence[Verdict], path: Path) -> None:
    """Write the verdicts as JUnit XML, as pytest does. Raises ConfigurationError if it cannot.

    What is not met is a failure; what is not decided is an error.
    """
    counts = {
        "tests": len(verdicts),
        "failures": sum(one.outcome == NOT_MET for one in verdicts),
        "errors": sum(one.outcome == UNDECIDED for one in verdicts),
        "skipped": 0,
        "time": f"{sum(one.wall_s for one in verdicts):.3f}",
    }
    attributes = {key: str(value) for key, value in counts.items()}
    name = results.loaded.experiment.name
    root = ElementTree.Element("testsuites", {"name": "drone-mesh-lab", **attributes})
    started = str(results.sessions[-1]["started"])
    suite = ElementTree.SubElement(
        root, "testsuite", {"name": name, **attributes, "timestamp": started}
    )
    for one in verdicts:
        about = {"classname": name, "name": one.name, "time": f"{one.wall_s:.3f}"}
        case = ElementTree.SubElement(suite, "testcase", about)
        if one.outcome != MET:
            kind = "failure" if one.outcome == NOT_MET else "error"
            what = {"message": f"{one.outcome}: {one.reason}", "type": one.outcome}
            ElementTree.SubElement(case, kind, what).text = f"{one.name}\n{one.reason}"
    try:
        ElementTree.ElementTree(root).write(str(path), encoding="utf-8", xml_declaration=True)
    except OSError as error:
        raise ConfigurationError(f"cannot write {path}: {error.strerror}") from error
