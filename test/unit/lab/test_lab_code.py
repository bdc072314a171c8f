"""Runs of different code are told from each other, and never mixed in one cell without a word."""

from __future__ import annotations

import json
import re
import sqlite3
import sys
from pathlib import Path
from typing import Callable, Iterator

import pytest

from drone_mesh.lab.command import _parser, main
from drone_mesh.lab.provenance import imported_code, own_code
from drone_mesh.lab.store import read_failures, read_runs
from drone_mesh.lab.terminal import _program as typed

ROOT = Path(__file__).resolve().parents[3]
LAB = ROOT / "src/drone_mesh/lab"
EXPERIMENT = """\
name: mine
seeds: 2
base: {layout: {kind: line, drones: 3}, duration_s: 15}
sweep: {repair: [stay, "edited_repair:Mine"]}
metrics: [packets]
compare: {over: repair, baseline: stay}
"""
STRATEGY = "from edited_helper import Stay\n\n\nclass Mine(Stay):\n    pass\n"
HELPER = "from drone_mesh.communication.repair.strategies import Stay\n"


@pytest.fixture
def edit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[str, str], None]:
    """Writes a module of the user, which the next `lab run` imports, as a new process would."""
    monkeypatch.setattr(sys, "path", list(sys.path))
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.yaml").write_text(EXPERIMENT)

    def write(name: str, text: str) -> None:
        (tmp_path / f"{name}.py").write_text(text)
        for module in ("edited_repair", "edited_helper"):
            monkeypatch.delitem(sys.modules, module, raising=False)
        imported_code.cache_clear()

    write("edited_repair", STRATEGY)
    write("edited_helper", HELPER)
    yield write
    imported_code.cache_clear()


def lab(*words: str) -> int:
    return main(list(words))


def run(*words: str) -> int:
    return lab("run", "mine.yaml", "--out", "out", "--workers", "0", *words)


def make_older(folder: str, where: str) -> None:
    """As if other code had done some of its runs."""
    database = sqlite3.connect(f"{folder}/runs.sqlite")
    with database:
        for run, row in database.execute(f"SELECT run, row FROM runs WHERE {where}").fetchall():
            older = json.dumps({**json.loads(row), "code": "older"})
            database.execute("UPDATE runs SET code='older', row=? WHERE run=?", (older, run))
    database.close()


MINE = "row LIKE '%edited_repair:Mine%'"
MINE_FIRST = f'{MINE} AND row LIKE \'%"repetition": "0"%\''


@pytest.mark.parametrize("module", ["edited_repair", "edited_helper"])
def test_new_seeds_of_an_edited_strategy_are_refused_until_the_older_runs_are_repeated(
    edit: Callable[[str, str], None], capsys: pytest.CaptureFixture[str], module: str
) -> None:
    assert run() == 0
    before = read_runs(Path("out"))
    edit(module, f"{STRATEGY if module == 'edited_repair' else HELPER}\nEDITED = True\n")
    capsys.readouterr()
    assert run("seeds=3") == 1
    error = capsys.readouterr().err
    assert "out: 2 runs are of an older edited_repair.py: `--again` repeats them, ano" in error
    assert error.rstrip().endswith("--workers 0 seeds=3 --again")
    assert read_runs(Path("out")) == before
    assert run("seeds=3", "--again") == 0
    after = read_runs(Path("out"))
    assert len(after) == 6
    codes = {(row["repair"], row["code"].partition(" ")[2]) for row in after.values()}
    assert codes == {("stay", ""), ("edited_repair:Mine", own_code(["edited_repair"], "."))}
    assert [run for run in before if before[run] == after[run]] == [
        run for run, row in before.items() if row["repair"] == "stay"
    ]


def test_a_finished_experiment_of_older_code_says_so_and_keeps_its_runs(
    edit: Callable[[str, str], None], capsys: pytest.CaptureFixture[str]
) -> None:
    run()
    edit("edited_repair", f"{STRATEGY}\nEDITED = True\n")
    capsys.readouterr()
    assert run() == 0
    assert "2 runs are of an older edited_repair.py: `--again` rep" in capsys.readouterr().out


def test_a_worker_that_imported_an_older_module_fails_its_runs(
    edit: Callable[[str, str], None], tmp_path: Path
) -> None:
    run("seeds=1")
    (tmp_path / "edited_helper.py").write_text(f"{HELPER}\nEDITED = True\n")
    assert run("seeds=1", "--again") == 1
    (failure,) = read_failures(Path("out"))
    assert "this worker imported an older" in failure["message"]


def test_status_tables_and_report_mark_a_cell_of_mixed_code_and_compare_refuses_it(
    edit: Callable[[str, str], None], capsys: pytest.CaptureFixture[str]
) -> None:
    run()
    make_older("out", MINE_FIRST)
    capsys.readouterr()
    lab("status", "out")
    assert (
        "warning: cells of mixed code: 1; `python3 -m drone_mesh.lab run`"
        in capsys.readouterr().out
    )
    lab("tables", "out")
    printed = capsys.readouterr().out
    assert "| edited_repair:Mine | 2 (mixed code) |" in printed
    assert "| stay | 2 |" in printed
    assert "| edited_repair:Mine | packets | 2 (mixed code) |" in printed
    lab("report", "out")
    assert "where one cell mixes them" in Path("out/report.html").read_text()
    assert lab("compare", "out", "repair=stay", "repair=edited_repair:Mine") == 1
    assert "a cell mixes runs of different code (" in capsys.readouterr().err


def test_two_folders_are_compared_run_by_run(
    edit: Callable[[str, str], None], capsys: pytest.CaptureFixture[str]
) -> None:
    lab("run", "mine.yaml", "--out", "old", "--workers", "0")
    make_older("old", "1")
    run("seeds=3")
    capsys.readouterr()
    assert lab("compare", "old", "out") == 0
    a, b, _, first, row, *_ = capsys.readouterr().out.splitlines()
    assert a == "A: old, code older"
    assert b.startswith("B: out, code ")
    assert first == "repair=stay"
    assert row.split()[:2] == ["packets", "2"]
    run("seed=9", "seeds=1")
    lab("run", "mine.yaml", "--out", "other", "--workers", "0", "seed=9", "seeds=1")
    capsys.readouterr()
    assert lab("compare", "old", "other") == 1
    assert "old and other have no run in common" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("started", "environment", "named"),
    [
        ("/usr/bin/drone-mesh-lab", {}, "drone-mesh-lab"),
        ("/src/drone_mesh/lab/__main__.py", {}, "python3 -m drone_mesh.lab"),
        ("/src/x/__main__.py", {"DRONE_MESH_LAB": "scripts/lab"}, "scripts/lab"),
    ],
)
def test_hints_name_the_command_that_was_typed(
    monkeypatch: pytest.MonkeyPatch, started: str, environment: dict[str, str], named: str
) -> None:
    monkeypatch.setattr(sys, "argv", [started])
    for name, value in environment.items():
        monkeypatch.setenv(name, value)
    assert typed() == named


OF_OTHER_PROGRAMS = ("command", "provenance")  # have options of git, and those that are declared


def hints() -> Iterator[tuple[Path, str]]:
    """What the lab prints, with PROGRAM for its own name, and what pages and experiments say."""
    for path in [*LAB.rglob("*.py"), LAB / "experiment.template.yaml", LAB / "report.html"]:
        text = path.read_text(encoding="utf-8")
        yield path, re.sub(r"\{+ ?(?:PROGRAM|program) ?\}+", "PROGRAM", text)
    for pages in ("README.md", "docs/**/*.md", "experiments/*.yaml"):
        for path in ROOT.glob(pages):
            yield path, path.read_text(encoding="utf-8")


def test_every_hint_names_a_command_and_options_that_exist() -> None:
    (commands,) = (one.choices for one in _parser()._actions if isinstance(one.choices, dict))
    options = {name for one in commands.values() for name in one._option_string_actions}
    found = 0
    for path, text in hints():
        for match in re.finditer(r"(?:PROGRAM|drone-mesh-lab|scripts/lab|`lab) ([a-z]+)", text):
            assert match[1] in commands, (path, match[0])
            found += 1
        if path.parent == LAB and path.suffix == ".py" and path.stem not in OF_OTHER_PROGRAMS:
            assert set(re.findall(r"(?<![-\w])--[a-z][a-z-]+", text)) <= options, path
    assert found > 40


def test_the_help_of_the_script_names_every_command() -> None:
    (commands,) = (one.choices for one in _parser()._actions if isinstance(one.choices, dict))
    text = (ROOT / "scripts" / "lab").read_text(encoding="utf-8")
    named = text.partition("explain a command: ")[2].partition("\nHELP")[0]
    assert set(re.findall(r"\w+", named)) == set(commands)


def test_the_hash_of_a_module_is_of_what_it_imports_from_the_users_folder_alone(
    tmp_path: Path,
) -> None:
    package = tmp_path / "pack"
    package.mkdir()
    files = {
        package / "__init__.py": "",
        package / "one.py": "import json\nfrom . import two\nfrom .three import x\n",
        package / "two.py": "def f():\n    import four\n",
        package / "three.py": "x = 1\n",
        tmp_path / "four.py": "def broken(:\n",
        tmp_path / "unused.py": "",
    }
    for file, text in files.items():
        file.write_text(text)
    first = own_code(["pack.one"], str(tmp_path))
    assert first.startswith("pack.one:")
    for file, text in files.items():
        file.write_text(f"{text}# edited\n")
        assert (own_code(["pack.one"], str(tmp_path)) != first) == (file.name != "unused.py")
        file.write_text(text)
    assert own_code(["no_such"], str(tmp_path)) == "no_such:missing"
