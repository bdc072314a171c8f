"""scripts/autopilots says in one line what it lacks."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[2] / "autopilot"))
from arducopter import program_from_environment
from autopilots import main


@pytest.mark.parametrize(
    ("program", "missing"),
    [
        (None, "ARDUCOPTER=/path/to/arducopter is not set"),
        ("/no/such/arducopter", "ARDUCOPTER=/no/such/arducopter is not a program"),
        ("/bin/true", "ARDUCOPTER_PARAMETERS=/path/to/copter.parm is needed"),
    ],
)
def test_without_the_autopilot_s_software_it_says_what_to_set(
    program: str | None,
    missing: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.delenv("ARDUCOPTER_PARAMETERS", raising=False)
    monkeypatch.delenv("ARDUCOPTER", raising=False)
    if program is not None:
        monkeypatch.setenv("ARDUCOPTER", program)
    assert main(["2"]) == 1
    said = capsys.readouterr().err
    assert said.startswith(f"scripts/autopilots: {missing}")
    assert said.count("\n") == 1


def test_the_parameters_may_lie_elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / "copter.parm"
    file.write_text("FRAME_CLASS 1\n")
    monkeypatch.setenv("ARDUCOPTER", "/bin/true")
    monkeypatch.setenv("ARDUCOPTER_PARAMETERS", str(file))
    assert program_from_environment()[1] == file
