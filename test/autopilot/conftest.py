"""Tests that fly ArduPilot's own software: `ARDUCOPTER=/path scripts/test autopilot`."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import Iterator

import pytest

collect_ignore_glob = [] if "ARDUCOPTER" in os.environ else ["test_*.py"]


@pytest.fixture(scope="session")
def program() -> tuple[Path, Path]:
    """The binary and its parameter file."""
    from drone_mesh.raspberry.arducopter import program_from_environment

    return program_from_environment()


@pytest.fixture(scope="session", autouse=True)
def busy_loops() -> Iterator[None]:
    """AUTOPILOT_BUSY_LOOPS programs beside the flights that take all the time they can get."""
    loops = [
        subprocess.Popen([sys.executable, "-c", "while True: pass"])
        for _ in range(int(os.environ.get("AUTOPILOT_BUSY_LOOPS", "0")))
    ]
    yield
    for loop in loops:
        loop.kill()
        loop.wait()
