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
from drone_mesh.lab.terminal import PROGRAM, as_duration

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
        return f"{self.expectation.text} [{self.cell}]" if self.cell else self.expectation.text


def judge(results: Results) -> list[Verdict]:
    """Judge all expectations. Raises ConfigurationError if there are none."""
    expected = results.loaded.experiment.expect
    if not expected:
        raise ConfigurationError(
            f"{results.folder}: the experiment has no `expect:`, a list such as [healed >= 0.95]"
        )
    return [one for text in expected for one in _judge(results, Expectation.parse(text))]


def _judge(results: Results, expectation: Expectation) -> Iterator[Verdict]:
    cells = results.loaded.cells
    try:
        pairs = expectation.cells([cell.texts for cell in cells])
    except ConfigurationError:  # an override has taken them out of the sweep
        yield Verdict(expectation, "", UNDECIDED, "the experiment has no such cells now")
        return
    for index, other in pairs:
        both = [index] if other is None else [index, other]
        wall_s = sum(float(row["wall_s"]) for cell in both for row in results.drawn(cell).values())
        outcome, reason = UNDECIDED, _unfit(results, both)
        if not reason:
            interval = _interval(results, expectation.metric, both)
            outcome = outcome_of(interval, expectation)
            reason = f"{interval}, {interval.n} {'runs' if other is None else 'seeds'}"
            if outcome == UNDECIDED:
                drawn = max(len(results.drawn(cell)) for cell in both)
                reason += f"; {_remedy(expectation, interval, drawn, wall_s)}"
        yield Verdict(expectation, cells[index].label, outcome, reason, wall_s)


def _unfit(results: Results, cells: Sequence[int]) -> str:
    """Why these cells cannot be judged; empty: they can."""
    ours = (one for one in results.plan if one.cell in cells and not one.is_control)
    missing = sum(one.spec.run not in results.rows for one in ours)
    if missing:
        return f"{missing} runs are missing or failed: `{PROGRAM} run` with --retry-failed"
    codes = {code.partition(" ")[0] for cell in cells for code in results.codes(cell)}
    mixed = len(codes) > 1 or any(len(results.codes(cell)) > 1 for cell in cells)
    again = f"the runs are of different code: `{PROGRAM} run` with --again repeats the older"
    return again if mixed else ""


def _interval(results: Results, metric: str, cells: Sequence[int]) -> Interval:
    """Of the metric, or of the difference to the other cell."""
    if len(cells) == 1:
        return summary_of(results.of_cell(cells[0]), metric)
    ours, others = paired(*results.pairs(*cells), metric)
    found = paired_difference(others, ours).difference
    if is_share(metric) and found.low == found.high:  # resampling finds no other value
        rare = share_interval(0, found.n).high
        low, high = max(-1.0, found.low - rare), min(1.0, found.high + rare)
        found = found._replace(low=low, high=high)
    return found


def outcome_of(interval: Interval, expectation: Expectation) -> str:
    """MET if the whole interval is on the wanted side of the bound, NOT_MET if none of it is."""
    low, high, bound = interval.low, interval.high, expectation.bound
    if expectation.relation[0] == "<":
        low, high, bound = -high, -low, -bound
    if "=" in expectation.relation:
        return MET if low >= bound else NOT_MET if high < bound else UNDECIDED
    return MET if low > bound else NOT_MET if high <= bound else UNDECIDED


def _remedy(expectation: Expectation, now: Interval, drawn: int, wall_s: float) -> str:
    """How many seeds would decide it, if the mean stays where it is; of those drawn, few count."""
    if math.isnan(now.low):
        return "too few runs count"
    n = now.n
    while n < MOST_RUNS:
        n = math.ceil(n * _STEP)
        if is_share(expectation.metric) and not expectation.other:
            guess = share_interval(round(now.value * n), n)
        else:
            shrunk = math.sqrt(now.n / n)
            low, high = (now.value + (end - now.value) * shrunk for end in now[1:3])
            guess = Interval(now.value, low, high, n)
        if outcome_of(guess, expectation) != UNDECIDED:
            seeds = math.ceil(drawn * n / now.n)
            more = as_duration(wall_s * (seeds / drawn - 1))
            return f"about {seeds} seeds would decide it ({more} of one core more)"
    return f"not even {MOST_RUNS} runs would"


def write_junit(results: Results, verdicts: Sequence[Verdict], path: Path) -> None:
    """Write the verdicts as JUnit XML, as pytest does. Raises ConfigurationError if it cannot.

    What is not met is a failure; what is not decided is an error.
    """
    name, found = results.loaded.experiment.name, [one.outcome for one in verdicts]
    root = ElementTree.Element("testsuites")
    about: dict[str, object] = {"name": name, "tests": len(found), "skipped": 0}
    about.update(failures=found.count(NOT_MET), errors=found.count(UNDECIDED))
    about.update(time=f"{sum(one.wall_s for one in verdicts):.3f}")
    about.update(timestamp=results.sessions[-1]["started"])
    suite = ElementTree.SubElement(root, "testsuite", {k: str(v) for k, v in about.items()})
    for one in verdicts:
        words = {"classname": name, "name": one.name, "time": f"{one.wall_s:.3f}"}
        case = ElementTree.SubElement(suite, "testcase", words)
        if one.outcome != MET:
            what = {"message": f"{one.outcome}: {one.reason}", "type": one.outcome}
            ElementTree.SubElement(case, "failure" if one.outcome == NOT_MET else "error", what)
    try:
        ElementTree.ElementTree(root).write(str(path), encoding="utf-8", xml_declaration=True)
    except OSError as error:
        raise ConfigurationError(f"cannot write {path}: {error.strerror}") from error
