"""Every program of an installation without extras runs, or names the extra that it needs."""

from __future__ import annotations

import configparser
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
RUN_ALL = """
import contextlib, importlib, io, sys

class OnlyTheBase:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] not in {"drone_mesh", "numpy"} | sys.stdlib_module_names:
            raise ImportError(f"No module named {name!r}", name=name)

sys.meta_path.insert(0, OnlyTheBase())
for line in sys.argv[1:]:
    name, _, target = line.partition(" = ")
    module, _, function = target.partition(":")
    sys.argv = [name, "--help"]
    said = io.StringIO()
    with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
        try:
            status = getattr(importlib.import_module(module), function)()
        except SystemExit as end:
            status = end.code
    print(name, status, said.getvalue().partition("\\n")[0])
"""


@pytest.mark.skipif(sys.version_info < (3, 10), reason="sys.stdlib_module_names")
def test_each_console_script_runs_or_names_its_extra_in_a_line():
    settings = configparser.ConfigParser()
    settings.read(ROOT / "setup.cfg")
    scripts = settings["options.entry_points"]["console_scripts"].strip().splitlines()
    done = subprocess.run(
        [sys.executable, "-c", RUN_ALL, *scripts],
        env={"PYTHONPATH": str(ROOT / "src")},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    said = [line.split(" ", 2) for line in done.stdout.splitlines()]
    assert [name for name, *_ in said] == [line.partition(" = ")[0] for line in scripts]
    for name, status, first_line in said:
        if status == "0":
            assert first_line.startswith("usage: "), name
        else:
            assert first_line.endswith(("drone_mesh[lab]'", "drone_mesh[console]'")), first_line
