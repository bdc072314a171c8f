"""What an experiment expects is judged on intervals; a control shows what other seeds change."""

from __future__ import annotations

import math
from pathlib import Path
from xml.etree import ElementTree

import pytest

from drone_mesh.errors import ConfigurationError
from drone_mesh.lab.command import main
from drone_mesh.lab.expectations import Expectation, matching
from drone_mesh.lab.experiment import load_experiment
from drone_mesh.lab.gate import MET, NOT_MET, UNDECIDED, judge, outcome_of
from drone_mesh.lab.results import load_results
from drone_mesh.lab.statistics import Interval, share_interval
from drone_mesh.lab.tables import paired_table, warning_of

EXPERIMENT = """\
name: gate
seeds: 8
base:
  layout: {kind: line, drones: 4}
  faults: [{at_s: 12, kill: {ids: [3]}}]
  duration_s: 30
sweep: {radio.loss: [0, 0.3], repair: [thesis, stay]}
metrics: [healed, packets]
compare: {over: radio.loss, baseline: 0}
control: true
expect:
"""
CELLS = [
    {"repair": repair, "share": share, "loss": loss}
    for repair in ("thesis", "stay") for share in ("0.1", "0.3") for loss in ("0.1", "0")
]  # fmt: skip


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("gate")
    (made / "gate.yaml").write_text(f"{EXPERIMENT}  - packets >= 1\n")
    run = ("run", made / "gate.yaml", "--out", made / "results", "--workers", 0)
    assert main(list(map(str, run))) == 0
    return made / "results"


def check(folder: Path, expected: str, *words: str) -> int:
    path = folder / "experiment.yaml"
    path.write_text(f"{EXPERIMENT}  - {expected}\n")
    return main(["check", str(folder), *words])


@pytest.mark.parametrize(
    ("low", "high", "expected", "outcome"),
    [
        (0.95, 1, "healed >= 0.95", MET),
        (0.95, 1, "healed > 0.95", UNDECIDED),
        (0.9, 0.95, "healed > 0.95", NOT_MET),
        (0.9, 0.95, "healed >= 0.95", UNDECIDED),
        (0.9, 0.94, "healed >= 0.95", NOT_MET),
        (0, 0, "collisions <= 0", MET),
        (1, 3, "collisions < 4", MET),
        (1, 3, "collisions of all < .4e+1", MET),
        (1, 3, "collisions < 1", NOT_MET),
        (1, 3, "collisions <= 2", UNDECIDED),
        (-0.02, 0.1, "pdr_up of a >= b - 0.02", MET),
        (-0.03, 0.1, "pdr_up of a >= b - 0.02", UNDECIDED),
        (math.nan, math.nan, "healed >= 0", UNDECIDED),
    ],
)
def test_the_whole_interval_must_be_on_the_wanted_side(
    low: float, high: float, expected: str, outcome: str
) -> None:
    interval = Interval((low + high) / 2, low, high, 20)
    assert outcome_of(interval, Expectation.parse(expected)) == outcome


def test_cells_are_named_by_axis_and_value_or_by_a_value_that_one_axis_has_alone() -> None:
    assert matching(CELLS, "") == list(range(8))
    assert matching(CELLS, "stay") == matching(CELLS, "repair=stay") == [4, 5, 6, 7]
    assert matching(CELLS, "stay,share=0.3,0") == [7]
    for unclear in ("0.1", "nearest", "speed=3"):
        with pytest.raises(ConfigurationError, match="expected axis=value with one of repair, sh"):
            matching(CELLS, unclear)
    pairs = Expectation.parse("t of stay,0.3 > thesis").cells(CELLS)
    assert pairs == [(6, 2), (7, 3)]  # all else is equal
    with pytest.raises(ConfigurationError, match="no such cells"):
        Expectation.parse("t of stay > stay").cells(CELLS)


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("healed", "expected METRIC >= NUMBER"),
        ("healed == 1", "expected METRIC >= NUMBER"),
        ("healed > stay", "expected METRIC >= NUMBER"),  # of which cells?
        ("heeled >= 1", "unknown metric heeled; did you mean healed"),
        ("t_total_s <= 60", "t_total_s leaves out runs that did not heal: use healed, or t_capped"),
        ("healed of 0.3 > 0", "write radio.loss=0 for a cell, 0.000 for a number"),
        ("healed of home > stay", "cell home: expected axis=value with one of radio.loss, repair"),
    ],
)
def test_a_statement_that_cannot_be_judged_is_refused_with_its_line(
    tmp_path: Path, line: str, words: str
) -> None:
    path = tmp_path / "gate.yaml"
    path.write_text(f"{EXPERIMENT}  - {line}\n")
    with pytest.raises(ConfigurationError, match=r"gate.yaml, line 12: expect: .*" + words):
        load_experiment(path)
    path.write_text(EXPERIMENT.replace("compare:", "#").replace("expect:", ""))
    with pytest.raises(ConfigurationError, match="control: give the baseline, with compare"):
        load_experiment(path)


@pytest.mark.parametrize(
    ("expected", "status", "words"),
    [
        ("packets of 0 >= 1", 0, "met          packets of 0 >= 1 [radio.loss=0 repair=thesis]"),
        ("packets of radio.loss=0.3 > 5", 0, "2 met, 0 not met, 0 not decided"),
        ("packets of 0.3 > radio.loss=0", 0, "8 seeds"),
        ("packets of stay > thesis", 1, "not met      packets of stay > thesis"),
        ("healed of stay,0 >= 0.99", 1, "seeds would decide it ("),
        ("healed of stay > thesis", 1, "-0.324, 0.324], 8 seeds; not even 10000 runs would"),
        ("healed of stay >= thesis - 0.4", 0, "2 met"),
    ],
)
def test_the_exit_status_says_whether_all_is_met(
    folder: Path, capsys: pytest.CaptureFixture[str], expected: str, status: int, words: str
) -> None:
    assert check(folder, expected) == status
    assert words in capsys.readouterr().out


def test_the_seeds_that_it_names_do_decide_it(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    check(folder, "healed of repair=stay,radio.loss=0 >= 0.9")
    shown = capsys.readouterr().out
    seeds = int(shown.partition("about ")[2].partition(" seeds")[0])
    assert share_interval(8, 8).low < 0.9 <= share_interval(seeds, seeds).low
    assert share_interval(seeds - 3, seeds - 3).low < 0.9  # and few more than are needed


def test_runs_that_are_missing_decide_nothing(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out, file = tmp_path / "part", tmp_path / "gate.yaml"
    file.write_text(f"{EXPERIMENT}  - packets >= 1\n")
    words = ("run", file, "--out", out, "--workers", 0, "--shard", "0/4")
    assert main(list(map(str, words))) == 0
    assert f"check {out}` judges what it expects" in capsys.readouterr().out
    assert check(out, "packets >= 1") == 1
    assert " runs are missing or failed: `" in capsys.readouterr().out


def test_runs_of_the_control_decide_nothing_and_mixed_code_names_the_remedy(folder: Path) -> None:
    check(folder, "packets of 0 >= 1")
    results = load_results(folder)
    controls = {one.spec.run for one in results.plan if one.is_control}
    without = {run: row for run, row in results.rows.items() if run not in controls}
    assert [one.outcome for one in judge(results._replace(rows=without))] == [MET, MET]
    mixed = {0: {r: {**row, "code": f"c{r % 2}"} for r, row in results.by_cell[0].items()}}
    verdict, _ = judge(results._replace(by_cell={**results.by_cell, **mixed}))
    assert verdict.outcome == UNDECIDED
    assert "run` with --again repeats" in verdict.reason


def test_an_experiment_that_expects_nothing_is_refused_with_an_example(folder: Path) -> None:
    (folder / "experiment.yaml").write_text(EXPERIMENT.replace("expect:", ""))
    with pytest.raises(
        ConfigurationError, match=r"no `expect:`, a list such as \[healed >= 0.95\]"
    ):
        judge(load_results(folder))


def test_a_ci_server_gets_junit_xml(folder: Path, tmp_path: Path) -> None:
    path = tmp_path / "gate.xml"
    check(folder, "packets of stay > thesis\n  - healed of 0 >= 0.99", "--junit", str(path))
    suite = ElementTree.parse(str(path)).getroot().find("testsuite")
    assert suite is not None
    assert {key: suite.get(key) for key in ("name", "tests", "failures", "errors", "skipped")} == {
        "name": "gate", "tests": "4", "failures": "2", "errors": "2", "skipped": "0",
    }  # fmt: skip
    cases = suite.findall("testcase")
    assert [[child.tag for child in case] for case in cases] == [["failure"]] * 2 + [["error"]] * 2
    assert cases[0].get("name") == "packets of stay > thesis [radio.loss=0 repair=stay]"
    assert "not met: 0 [0, 0], 8 seeds" in cases[0][0].get("message", "")
    assert main(["check", str(folder), "--junit", str(tmp_path / "no/x.xml")]) == 1


def test_a_control_runs_the_baseline_on_other_seeds_and_gives_each_difference_a_scale(
    folder: Path, tmp_path: Path
) -> None:
    results = load_results(folder)
    assert len(results.plan) == (4 + 2) * 8  # the baseline has two cells
    ours, others = results.drawn(0), results.controls[0]
    assert len(others) == len(ours) == 8
    hashes = [{row["event_hash"] for row in rows.values()} for rows in (ours, others)]
    assert hashes[0].isdisjoint(hashes[1])
    table = paired_table(results)
    assert table is not None
    rows = {(*row[:2], row[2]): row for row in table.rows}
    assert table.header[-1] == "spread of A/A"
    control = rows["0, other seeds", "thesis", "packets"]
    assert control[3] == "8"
    assert control[-1] == ""
    lossy = rows["0.3", "thesis", "packets"]
    spread = max(abs(float(end)) for end in control[4].partition("[")[2].rstrip("]").split(","))
    kind, _, shown = lossy[-1].partition(" ")
    assert float(shown) == pytest.approx(spread)
    assert (kind == "within") == (abs(float(lossy[4].split()[0])) <= spread)


def test_most_draws_without_a_need_for_a_repair_are_warned_of(folder: Path) -> None:
    assert warning_of(load_results(folder)).startswith("32 of 32 draws needed no repair")
    path = folder / "experiment.yaml"
    path.write_text(path.read_text().replace("control:", "draws: whole\ncontrol:"))
    assert warning_of(load_results(folder)) == ""
