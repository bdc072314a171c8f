"""The ten minutes of docs/lab.md, as a reader types them: fewer and shorter runs, same commands."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest

from drone_mesh.lab.command import main
from drone_mesh.lab.store import read_runs

PAGE = Path(__file__).resolve().parents[3] / "docs/lab.md"
WALK = PAGE.read_text(encoding="utf-8").partition("## The experiment file")[0]
SHORTER = {"seeds: 50": "seeds: 6", "drones: 50": "drones: 20", "duration_s: 240": "duration_s: 80"}


def block(language: str, holds: str) -> str:
    found = [
        text for kind, text in re.findall(r"```(\w+)\n(.*?)```", WALK, re.DOTALL)
        if kind == language and holds in text
    ]  # fmt: skip
    (text,) = found
    return text


def sessions() -> list[list[str]]:
    """The commands of the walk, in their order, each with the output that the page shows."""
    return [
        text.splitlines()
        for text in re.findall(r"```\n\$ drone-mesh-lab (.*?)```", WALK, re.DOTALL)
    ]


@pytest.mark.slow
def test_every_command_of_the_page_works_in_its_order(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    experiment = block("yaml", "name: half_way")
    for old, new in SHORTER.items():
        assert old in experiment
        experiment = experiment.replace(old, new)
    (tmp_path / "half_way.yaml").write_text(experiment, encoding="utf-8")
    (tmp_path / "half_way.py").write_text(block("python", "class HalfWay"), encoding="utf-8")
    commands = []
    for typed, *shown in sessions():
        words = shlex.split(typed)
        commands.append(words[0])
        if words[0] == "show":  # the page shows a run of its own
            rows = read_runs(tmp_path / "results/half_way")
            words[2] = next(run[:8] for run, row in rows.items() if row["repair"] != "thesis")
        assert main(words) == 0, typed
        printed = capsys.readouterr().out
        if words[0] == "plan":
            assert printed.splitlines()[:2] == shown[:2]
        if words[0] == "compare":
            assert printed.splitlines()[:2] == shown[:2]
            metrics = [line.split()[0] for line in shown[3:]]
            assert [line.split()[0] for line in printed.splitlines()[3:]] == metrics
        if words[0] == "show":
            assert "reproduces the run in results/half_way" in printed
    assert commands == ["plan", "run", "compare", "report", "plot", "show"]
    assert (tmp_path / "results/half_way/report.html").exists()
