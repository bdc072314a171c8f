"""An experiment file: what it means, and that each mistake in it is one line that points at it."""

from __future__ import annotations

import importlib
import os
import sys
import threading
from pathlib import Path
from typing import Any, Iterator

import pytest

from drone_mesh.errors import ConfigurationError
from drone_mesh.lab import experiment
from drone_mesh.lab.command import main
from drone_mesh.lab.experiment import load_experiment
from drone_mesh.lab.plan import Plan
from drone_mesh.lab.results import load_results
from drone_mesh.lab.scenario import Part, Scenario

GOOD = """\
name: trial
seeds: 3
base:
  layout: {kind: grid, drones: 5}
  duration_s: 5
  faults:
    - at_s: 2
      kill: {share: 0.1}
    - when: 10 s after the first flight
      revive: {number: 1}
sweep:
  faults.kill.share: [0.1, 0.5]
  radio.loss: [0, 0.2, 0.4]
"""


def write(folder: Path, text: str) -> Path:
    path = folder / "trial.yaml"
    path.write_text(text, encoding="utf-8")
    return path


def test_a_sweep_is_the_product_of_its_axes(tmp_path: Path) -> None:
    loaded = load_experiment(write(tmp_path, GOOD))
    assert [cell.label for cell in loaded.cells] == [
        "faults.kill.share=0.1 radio.loss=0",
        "faults.kill.share=0.1 radio.loss=0.2",
        "faults.kill.share=0.1 radio.loss=0.4",
        "faults.kill.share=0.5 radio.loss=0",
        "faults.kill.share=0.5 radio.loss=0.2",
        "faults.kill.share=0.5 radio.loss=0.4",
    ]
    last = loaded.cells[-1].scenario
    assert last.radio.loss == 0.4
    assert last.faults[0].kill is not None
    assert last.faults[0].kill.share == 0.5


def test_where_leaves_cells_out(tmp_path: Path) -> None:
    text = GOOD + "where: faults.kill.share < 0.3 or radio.loss in [0.4]\n"
    loaded = load_experiment(write(tmp_path, text))
    assert len(loaded.cells) == 4


def test_zip_moves_axes_in_step(tmp_path: Path) -> None:
    text = GOOD.split("sweep:")[0] + "zip:\n  - {layout.drones: [4, 9], duration_s: [5, 10]}\n"
    cells = load_experiment(write(tmp_path, text)).cells
    assert [(c.scenario.layout.drones, c.scenario.duration_s) for c in cells] == [(4, 5), (9, 10)]


def test_parts_may_be_shared_by_anchors_and_a_title_may_be_long(tmp_path: Path) -> None:
    shared = GOOD.replace("kill: {share: 0.1}", "kill: &some {share: 0.1}")
    shared = shared.replace("revive: {number: 1}", "revive: *some") + f"title: {'x' * 300}\n"
    faults = load_experiment(write(tmp_path, shared)).cells[0].scenario.faults
    assert faults[0].kill == faults[1].revive
    merged = GOOD.replace("revive: {number: 1}", "revive: {<<: {number: 1}, pick: busiest}")
    revive = load_experiment(write(tmp_path, merged)).cells[0].scenario.faults[1].revive
    assert (revive.number, revive.pick) == (1, "busiest")


def test_a_layout_with_places_within_the_clearance_is_refused(tmp_path: Path) -> None:
    text = GOOD.replace("revive: {number: 1}", "layouts: {cases: [100]}")
    wide = ["base.repair_options.clearance_m=6"]
    with pytest.raises(ConfigurationError, match="drones 1 and 2 would stand 5.00 m apart"):
        load_experiment(write(tmp_path, text), wide)


def test_an_argument_overrides_the_file(tmp_path: Path) -> None:
    path = write(tmp_path, GOOD)
    loaded = load_experiment(path, ["seeds=7", "base.range_m=12", "sweep.radio.loss=[0.1]"])
    assert loaded.experiment.seeds == 7
    assert loaded.cells[0].scenario.range_m == 12
    assert [cell.scenario.radio.loss for cell in loaded.cells] == [0.1, 0.1]


def test_a_range_that_no_node_takes_is_refused_when_the_file_is_read(tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match="range_m"):
        load_experiment(write(tmp_path, GOOD), ["base.range_m=20000"])


def test_a_run_keeps_its_id_when_seeds_or_cells_are_added(tmp_path: Path) -> None:
    path = write(tmp_path, GOOD)
    few = {planned.spec.run for planned in Plan(load_experiment(path))}
    more = ["seeds=5", "sweep.radio.loss=[0, 0.2, 0.3, 0.4]"]
    many = {planned.spec.run for planned in Plan(load_experiment(path, more))}
    assert len(few) == 18
    assert few < many


def test_a_default_that_is_written_out_is_the_same_run(tmp_path: Path) -> None:
    plain = [p.spec.run for p in Plan(load_experiment(write(tmp_path, GOOD)))]
    written = GOOD.replace("  duration_s: 5\n", "  duration_s: 5.0\n  range_m: 9\n")
    assert [p.spec.run for p in Plan(load_experiment(write(tmp_path, written)))] == plain


@pytest.mark.parametrize(
    ("old", "new", "line", "words"),
    [
        ("seeds: 3", "seedss: 3", 2, "unknown key seedss; did you mean seeds?"),
        ("seeds: 3", "seeds: 0", 2, "seeds: input should be greater than or equal to 1, not 0"),
        ("name: trial", "name: ../x", 1, "name: string should match pattern"),
        ("name: trial\n", "", 0, "missing key name"),
        ("kind: grid", "kind: grit", 4, "base.layout.kind: input should be 'uniform'"),
        ("drones: 5", "drone: 5", 4, "unknown key base.layout.drone; did you mean drones?"),
        ("drones: 5", "drones: 300", 4, "base.layout.drones: input should be less than or equal"),
        ("drones: 5", "mean_degree: 8", 4, "base.layout: layout grid has no mean_degree"),
        ("kind: grid, drones: 5", "kind: casus, ids: shuffled", 4, "layout casus has no ids: it"),
        ("at_s: 2", "at_s: -2", 7, "base.faults.0.at_s: input should be greater than or equal"),
        ("at_s: 2", "at_s: 5", 8, "faults.0.kill: begins at 5 s, after the end of the run"),
        ("  faults:", "  probes: {per_s: 1}\n  faults:", 6, "probes.from_s: begins at 22 s, after"),
        ("at_s: 2", "at: 2", 7, "unknown key base.faults.0.at; did you mean at_s?"),
        ("share: 0.1}", "share: 0.1, number: 3}", 8, "give exactly one of share, number"),
        ("revive: {number: 1}", "revive: {ids: [9]}", 10, "no drone 9; the layout has 0..4"),
        ("revive: {number: 1}", "gateway_off: {id: 1}", 10, "drone 1 is no gateway; use kill"),
        ("revive: {number: 1}", "layouts: {cases: [77]}", 10, "unknown case 77"),
        (
            "revive: {number: 1}",
            "order: {id: 1, to: [0, 5001]}",
            10,
            "order.to: latitude 5001 m is",
        ),
        (
            "at_s: 2\n      kill",
            "at_s: 1\n      load: {per_s: 1, counted_after_s: 4}\n    - at_s: 1\n      kill",
            8,
            "counts from 5 s on, after the end",
        ),
        (
            "revive: {number: 1}",
            "layouts: {cases: [101], ring_m: 0.8}",
            10,
            "5 drones would stand 0.94 m apart: the clearance is 1 m",
        ),
        ("  faults:", "  sequence: {drones: [9, 3]}\n  faults:", 6, "give the least first"),
        ("  faults:", "  sequence: {incidents: []}\n  faults:", 6, "should have at least 1 item"),
        ("kind: grid, drones: 5", "kind: casus, case: 99", 4, "layout.case: unknown case 99"),
        ("revive: {number: 1}", "cut_link: {between: [3, 3]}", 10, "a link is between two drones"),
        ("revive: {number: 1}", "cut_link: {between: [1, 2], number: 2}", 10, "give either"),
        (
            "  faults:",
            "  sequence: {}\n  radio: {kind: shared}\n  faults:",
            3,
            "for the disc radio",
        ),
        (
            "kill: {share: 0.1}",
            "kil: {share: 0.1}",
            12,
            "axis faults.kill.share: faults has no entry kill",
        ),
        (
            "10 s after the first flight",
            "some day",
            9,
            "expected 'when EVENT' or 'N s after EVENT'",
        ),
        ("the first flight", "the first fligth", 9, "did you mean 'the first flight'?"),
        ("radio.loss: [0, 0.2, 0.4]", "radio.lost: [0]", 13, "unknown key radio.lost; did you"),
        ("radio.loss: [0, 0.2, 0.4]", "radio.loss: [0, 2]", 13, "radio.loss: input should be less"),
        ("radio.loss: [0, 0.2, 0.4]", "radio.loss: []", 13, "sweep.radio.loss: no values"),
        ("radio.loss: [0, 0.2, 0.4]", "routing: [no_such]", 13, "routing technique 'no_such'"),
        ("radio.loss: [0, 0.2, 0.4]", "routing: [no such:X]", 13, "expected a name, or package."),
    ],
)
def test_each_mistake_is_one_line_with_file_line_and_key(
    tmp_path: Path, old: str, new: str, line: int, words: str
) -> None:
    assert old in GOOD
    path = write(tmp_path, GOOD.replace(old, new, 1))
    with pytest.raises(ConfigurationError) as caught:
        load_experiment(path)
    message = str(caught.value)
    assert message.startswith(f"{path}, line {line}: " if line else f"{path}: ")
    assert words in message
    assert "\n" not in message


@pytest.mark.parametrize(
    ("added", "line", "words"),
    [
        ("metrics: [healed, t_totl_s]", 14, "unknown metric t_totl_s; did you mean t_total_s?"),
        ("metrics: ['a/b:f']", 14, "'a/b:f': expected a name, or package.module:Name"),
        ("where: radio.loss < 'a' * 100000000000", 14, "where: use axes, numbers"),
        (f"where: {'(' * 480}1{')' * 480}", 14, "where: "),
        (f"where: 1 {'< 2' * 400}", 14, "where: longer than 1000 characters"),
        ("where: radio.los > 1", 14, "where: no axis radio.los"),
        ("where: __import__('os')", 14, "where: use axes, numbers"),
        ("where: radio.loss > 5", 14, "where excludes every cell"),
        ("where: radio.loss > 'a'", 14, "'int' and 'str', with {'faults.kill.share'"),
        ("where: faults.0.kill.share > 0.2", 14, "as in faults.kill.share"),
        ("metrics: ['own_metrics:healed']", 14, "metric own_metrics:healed: another one is also"),
        ("metrics: ['own_metrics:f', 'more_metrics:f']", 14, "metric more_metrics:f: another"),
        ("compare: {over: radio.los, baseline: 0}", 14, "did you mean radio.loss?"),
        ("compare: {over: radio.loss, baseline: 7}", 14, "7 is not a value of radio.loss"),
        ("stop: {metric: healed, max_seeds: 9}", 14, "give either half_width or"),
        ("seeds: 4", 14, "duplicate key seeds, first on line 2"),
        ("zip: [{a: [1], b: [1, 2]}]", 14, "the lists must have the same length"),
        ("zip: [{radio.loss: [0]}]", 14, "radio.loss is swept twice"),
    ],
)
def test_what_belongs_to_the_whole_file_is_checked_as_well(
    tmp_path: Path, added: str, line: int, words: str
) -> None:
    for name in ("own_metrics", "more_metrics"):
        functions = "healed = f = lambda record: 1.0\n"
        (tmp_path / f"{name}.py").write_text(functions, encoding="utf-8")
    path = write(tmp_path, f"{GOOD}{added}\n")
    with pytest.raises(ConfigurationError) as caught:
        load_experiment(path)
    message = str(caught.value)
    assert message.startswith(f"{path}, line {line}: ")
    assert words in message
    assert "\n" not in message


@pytest.mark.parametrize(
    "added", ["where: routing == 'beacon'", "compare: {over: routing, baseline: beacon}"]
)
def test_a_file_that_sweeps_nothing_has_no_axes(tmp_path: Path, added: str) -> None:
    path = write(tmp_path, GOOD.split("sweep:")[0] + added + "\n")
    with pytest.raises(ConfigurationError, match="no axis routing; .* none: nothing is swept"):
        load_experiment(path)


def test_an_axis_without_the_baseline_asks_for_another_baseline(tmp_path: Path) -> None:
    path = write(tmp_path, f"{GOOD}compare: {{over: radio.loss, baseline: 0.2}}\n")
    with pytest.raises(ConfigurationError, match=r"line 14: .*as in compare\.baseline=0\.4$"):
        load_experiment(path, ["sweep.radio.loss=[0.4]"])
    load_experiment(path, ["sweep.radio.loss=[0.4]", "compare.baseline=0.4"])


@pytest.mark.parametrize(
    ("argument", "words"),
    [
        ("sedes=3", "unknown key sedes; did you mean seeds?"),
        ("seeds", "expected key=value"),
        ("seeds=x", "seeds: input should be a valid integer, not 'x'"),
        ("seeds=010", "the value is not valid YAML"),
        ("base.radio.loss=0.5", "radio.loss is swept; use sweep.radio.loss=[0.5] instead"),
        ("base.layout.drnes=3", "unknown key base.layout.drnes; did you mean drones?"),
        ("base.faults.7.at_s=1", "base.faults has no entry 7"),
    ],
)
def test_a_bad_argument_is_named(tmp_path: Path, argument: str, words: str) -> None:
    with pytest.raises(ConfigurationError) as caught:
        load_experiment(write(tmp_path, GOOD), [argument])
    assert str(caught.value).startswith(f"argument {argument}: ")
    assert words in str(caught.value)


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (b"name: [", "trial.yaml, line 1: "),
        (b"\xff\xfe", "not a text file in UTF-8"),
        (b"- 1\n", "expected 'key: value' lines"),
        (b"", "expected 'key: value' lines"),
    ],
)
def test_an_invalid_experiment_file_is_refused(tmp_path: Path, data: bytes, words: str) -> None:
    path = tmp_path / "trial.yaml"
    path.write_bytes(data)
    with pytest.raises(ConfigurationError, match="trial.yaml") as caught:
        load_experiment(path)
    assert words in str(caught.value)


MODULES = {
    "syntax": "def f(:",
    "ends": "raise SystemExit(3)",
    "fails": "raise RuntimeError('two\\nlines')",
    "parts": """
from drone_mesh.communication.repair.interfaces import IRepairStrategy

class Abstract(IRepairStrategy):
    pass

class Fails(IRepairStrategy):
    def __init__(self):
        raise RuntimeError("no good")

    def on_emergency(self):
        pass
""",
}


@pytest.mark.parametrize(
    ("key", "value", "words"),
    [
        ("repair", "syntax:X", "cannot be loaded: SyntaxError: invalid syntax"),
        ("routing", "ends:X", "routing technique 'ends:X' cannot be loaded: SystemExit: 3"),
        ("routing", "fails:X", "'fails:X' cannot be loaded: RuntimeError: two lines"),
        ("repair", "parts:Fails", "without arguments: RuntimeError: no good"),
        ("repair", "parts:Missing", "has no attribute 'Missing'"),
        ("metrics", "syntax:f", "metric 'syntax:f' cannot be loaded: SyntaxError: invalid syntax"),
        ("metrics", "ends:f", "metric 'ends:f' cannot be loaded: SystemExit: 3"),
        ("metrics", "parts:f", "has no attribute 'f'"),
        ("metrics", "no_module:f", "metric 'no_module:f' cannot be loaded"),
        ("metrics", "os:getcwd", "must take one argument"),
        ("routing", "no.such:X", "cannot be loaded"),
        ("routing", "json:JSONDecoder", "ITechnique"),
    ],
)
def test_a_users_module_that_fails_gives_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, key: str, value: str, words: str
) -> None:
    folder = tmp_path / "modules"
    folder.mkdir()
    for name, content in MODULES.items():
        (folder / f"{name}.py").write_text(content)
        monkeypatch.delitem(sys.modules, name, raising=False)
    monkeypatch.syspath_prepend(str(folder))
    added = f"metrics: ['{value}']" if key == "metrics" else f"base:\n  {key}: '{value}'"
    path = write(tmp_path, f"name: trial\n{added}\n")
    loaded = load_experiment(path)
    with pytest.raises(ConfigurationError) as caught:
        loaded.check_own_code()
    assert str(caught.value).startswith(f"{path}: ")
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.fixture
def evil(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An experiment, and modules beside it that leave a trace when their code runs."""
    monkeypatch.setattr(sys, "path", list(sys.path))
    trace = tmp_path / "code ran"
    for name in ("evil_metric", "evil_repair", "colorsys"):
        monkeypatch.delitem(sys.modules, name, raising=False)
        code = (
            f"open({str(trace)!r}, 'a').write({name!r} + ' ')\ndef f(record): return 1.0\ng = f\n"
        )
        (tmp_path / f"{name}.py").write_text(code)
    metrics = "metrics: ['evil_metric:f', 'evil_repair:g']\n"
    base = "base: {layout: {kind: line, drones: 2}, duration_s: 1}\nseeds: 1\n"
    return write(tmp_path, f"name: trial\n{base}{metrics}")


def test_a_plan_without_estimate_makes_no_trial_runs(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = str(write(tmp_path, GOOD))
    assert main(["plan", path, "--no-estimate"]) == 0
    assert "trial runs" not in capsys.readouterr().out
    assert main(["plan", path]) == 0
    assert "trial runs" in capsys.readouterr().out


def test_only_a_run_loads_code_and_says_so_before(
    evil: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    trace = evil.parent / "code ran"
    monkeypatch.chdir(evil.parent)
    assert main(["plan", str(evil)]) == 0
    words = "no trial runs: they would import evil_metric, evil_repair; see --estimate"
    assert words in capsys.readouterr().out
    assert not trace.exists()
    assert main(["run", str(evil), "--workers", "0"]) == 0
    out = capsys.readouterr().out
    assert f"imports evil_metric, evil_repair, installed or in {evil.parent}: their code" in out
    assert trace.read_text() == "evil_metric evil_repair "
    trace.unlink()
    for name in ("evil_metric", "evil_repair"):
        monkeypatch.delitem(sys.modules, name)
    assert main(["status", "results/trial"]) == 0
    assert len(load_results(evil.parent / "results/trial").rows) == 1
    assert main(["new", "another"]) == 0
    assert not trace.exists()


def test_a_file_beside_the_experiment_does_not_stand_in_for_an_installed_module(
    evil: Path,
) -> None:
    load_experiment(evil).check_own_code()
    importlib.import_module("colorsys")
    assert "colorsys" not in (evil.parent / "code ran").read_text()


def test_an_experiment_has_a_bounded_number_of_cells_and_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    many = f"[{', '.join(map(str, range(1, 1001)))}]"
    axes = f"sweep: {{layout.drones: {many}, duration_s: {many}, sample_s: {many}}}\n"
    wrong = [
        (axes, "line 2: more than 1000000 combinations of the axes"),
        (
            "seeds: 1000000\nsweep: {duration_s: [1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11]}",
            "line 2: 11 cells x 1000000 seeds: more than 10000000 runs",
        ),
        ("stop: {metric: healed, half_width: 1, max_seeds: 2000000}", "less than or equal to"),
    ]
    for text, words in wrong:
        with pytest.raises(ConfigurationError, match=words):
            load_experiment(write(tmp_path, f"name: trial\n{text}\n"))
    monkeypatch.setattr(experiment, "MOST_CELLS", 5)
    with pytest.raises(ConfigurationError, match="more than 5 cells"):
        load_experiment(write(tmp_path, GOOD))


def keys_of(part: Any, before: tuple[str, ...] = ()) -> Iterator[tuple[str, ...]]:
    """Every key below `base`, by its path; the keys inside lists are left out."""
    for name, field in part.model_fields.items():
        yield (*before, name)
        if isinstance(field.annotation, type) and issubclass(field.annotation, Part):
            yield from keys_of(field.annotation, (*before, name))


@pytest.mark.parametrize("value", ["[[]]", ".nan", "-1.0e+300"])
@pytest.mark.parametrize("keys", list(keys_of(Scenario)), ids=".".join)
def test_every_key_refuses_what_is_of_another_type_or_out_of_range(
    tmp_path: Path, keys: tuple[str, ...], value: str
) -> None:
    lines = ["name: trial", "base:"]
    lines += [f"{'  ' * depth}{key}:" for depth, key in enumerate(keys, start=1)]
    lines[-1] += f" {value}"
    path = write(tmp_path, "\n".join(lines) + "\n")
    with pytest.raises(ConfigurationError) as caught:
        load_experiment(path)
    assert str(caught.value).startswith(f"{path}, line ")
    assert keys[-1] in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_missing_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match="No such file"):
        load_experiment(tmp_path / "none.yaml")


def test_an_experiment_may_come_from_a_pipe(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    writer = threading.Thread(target=pipe.write_text, args=(GOOD,), daemon=True)
    writer.start()
    assert len(load_experiment(pipe).cells) == 6
    writer.join()


def test_places_come_from_a_file_beside_the_experiment(tmp_path: Path) -> None:
    rows = '\ufeff"id", "x","y","role"\n0,0,0,gateway\n3,5,0,"router"\n'
    (tmp_path / "yard.csv").write_text(rows)
    text = "name: yard\nbase:\n  layout: {kind: file, path: yard.csv}\n"
    (cell,) = load_experiment(write(tmp_path, text)).cells
    assert cell.scenario.layout.places == [[0, 0, 0, 1], [3, 5, 0, 0]]


@pytest.mark.parametrize("key", ["ids: shuffled", "gateways: 2"])
def test_a_file_of_places_alone_says_who_is_who(tmp_path: Path, key: str) -> None:
    (tmp_path / "yard.csv").write_text("id,x,y,role\n0,0,0,gateway\n3,5,0,router\n")
    text = f"name: yard\nbase:\n  layout: {{kind: file, path: yard.csv, {key}}}\n"
    with pytest.raises(ConfigurationError, match=r"line 3: base\.layout: layout file has no"):
        load_experiment(write(tmp_path, text))


@pytest.mark.parametrize(
    ("rows", "words"),
    [
        ("0,0,0,gateway\n0,1,1,router\n", "line 3: id 0 is out of range or a duplicate"),
        ("0,0,0,router\n", "no gateway"),
        ("0,0,gateway\n", "line 2: expected id,x,y,role"),
        ("0,0,zero,gateway\n", "line 2: expected finite x, y"),
        ("0,0,\u0663,gateway\n", "line 2: expected finite x, y"),
        ("0_0,0,0,gateway\n", "line 2: id 0_0 is out of range"),
        ("0,0,1e308,gateway\n", "line 2: expected finite x, y"),
    ],
)
def test_a_bad_file_of_places_is_refused(tmp_path: Path, rows: str, words: str) -> None:
    (tmp_path / "yard.csv").write_text(f"id,x,y,role\n{rows}")
    text = "name: yard\nbase:\n  layout: {kind: file, path: yard.csv}\n"
    path = write(tmp_path, text)
    with pytest.raises(ConfigurationError) as caught:
        load_experiment(path)
    assert str(caught.value).startswith(f"{path}, line 3: ")
    assert words in str(caught.value)
