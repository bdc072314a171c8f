"""What becomes of the output of a program: nobody reads it, or not every character of it."""

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


def test_a_program_without_an_output_ends_as_well_as_any(tmp_path):
    code = "from drone_mesh.raspberry.key_command import main; raise SystemExit(main())"
    ended = subprocess.run(
        ["sh", "-c", 'exec "$@" >&-', "sh", sys.executable, "-c", code, "new", tmp_path / "key"],
        env={**os.environ, "PYTHONPATH": str(ROOT / "src")},
        stderr=subprocess.PIPE,
        text=True,
    )
    assert (ended.returncode, ended.stderr) == (0, "")


@pytest.mark.parametrize(
    ("encoding", "name", "told"),
    [
        ("ascii:strict", "caf\u00e9", rb"caf\xe9"),
        ("utf-8:strict", os.fsdecode(b"caf\xe9"), rb"caf\udce9"),
        ("utf-8:strict", "caf\u00e9", "caf\u00e9".encode()),
    ],
)
def test_what_a_terminal_cannot_show_is_written_as_its_number(tmp_path, encoding, name, told):
    code = "from drone_mesh.raspberry.key_command import main; raise SystemExit(main())"
    ended = subprocess.run(
        [sys.executable, "-c", code, "new", tmp_path / name],
        env={**os.environ, "PYTHONPATH": str(ROOT / "src"), "PYTHONIOENCODING": encoding},
        capture_output=True,
    )
    assert (ended.returncode, ended.stderr) == (0, b"")
    assert ended.stdout == b"raspberry_key: new mesh key in %s/%s\n" % (os.fsencode(tmp_path), told)


def test_a_full_disk_under_the_output_ends_a_program_with_one_line(tmp_path):
    code = "from drone_mesh.raspberry.key_command import main; raise SystemExit(main())"
    with open("/dev/full", "w") as full:
        ended = subprocess.run(
            [sys.executable, "-c", code, "new", tmp_path / "key"],
            env={**os.environ, "PYTHONPATH": str(ROOT / "src")},
            stdout=full,
            stderr=subprocess.PIPE,
            text=True,
        )
    assert (ended.returncode, ended.stderr) == (1, "raspberry_key: No space left on device\n")
