"""Tests that fly ArduPilot's own software: `ARDUCOPTER=/path scripts/test autopilot`."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import Iterator

import pytest
from copter_rig import FLOWN, WORKER

collect_ignore_glob = [] if "ARDUCOPTER" in os.environ else ["test_*.py"]


@pytest.fixture(scope="session")
def program() -> tuple[Path, Path]:
    """The binary and its parameter file."""
    from arducopter import program_from_environment

    return program_from_environment()


@pytest.fixture(scope="session", autouse=True)
def busy_loops() -> Iterator[None]:
    """AUTOPILOT_BUSY_LOOPS programs beside the flights that take all the time they can get."""
    loops = [
        subprocess.Popen([sys.executable, "-c", "while True: pass"])
        for _ in range(int(os.environ.get("AUTOPILOT_BUSY_LOOPS", "0")) if WORKER == 0 else 0)
    ]
    yield
    for loop in loops:
        loop.kill()
        loop.wait()


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """How many of the plain flights of each kind reached their goals."""
    counts: dict[str, tuple[int, int]] = {}
    for outcome in ("passed", "failed"):
        for report in terminalreporter.getreports(outcome):
            for kind, flown, reached in [v for name, v in report.user_properties if name == FLOWN]:
                before = counts.get(kind, (0, 0))
                counts[kind] = (before[0] + flown, before[1] + reached)
    for kind, (flown, reached) in sorted(counts.items()):
        terminalreporter.write_line(f"{kind}: {reached} of {flown} flights")
