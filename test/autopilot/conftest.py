"""Tests that fly ArduPilot's own software: `ARDUCOPTER=/path scripts/test autopilot`."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

collect_ignore_glob = [] if "ARDUCOPTER" in os.environ else ["test_*.py"]


@pytest.fixture(scope="session")
def program() -> tuple[Path, Path]:
    """The binary and its parameter file."""
    from drone_mesh.raspberry.arducopter import program_from_environment

    return program_from_environment()
