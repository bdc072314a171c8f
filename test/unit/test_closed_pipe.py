"""Programs whose reader ends, as in `raspberry_radio registers | head -n 1`, end quietly."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]

pytestmark = pytest.mark.slow


@pytest.mark.parametrize(
    ("main", "arguments"),
    [
        ("raspberry.radio_command:main", ["--help"]),
        ("raspberry.radio_command:main", ["test", "--emulated"]),
        ("raspberry.status_command:main", ["--help"]),
        ("raspberry.key_command:main", ["--help"]),
        ("users.commands:ping", ["--help"]),
        ("users.commands:send", ["--help"]),
        ("lab.command:main", ["--help"]),
    ],
)
def test_a_reader_that_has_closed_the_pipe_is_no_error(main, arguments):
    module, _, function = main.partition(":")
    reader, writer = os.pipe()
    os.close(reader)
    code = f"import sys; from drone_mesh.{module} import {function}; sys.exit({function}())"
    ended = subprocess.run(
        [sys.executable, "-c", code, *arguments],
        env={**os.environ, "PYTHONPATH": str(ROOT / "src")},
        stdout=writer,
        stderr=subprocess.PIPE,
        text=True,
    )
    os.close(writer)
    assert "Traceback" not in ended.stderr, ended.stderr
    assert "Exception ignored" not in ended.stderr, ended.stderr
    assert "Broken pipe" not in ended.stderr, ended.stderr
