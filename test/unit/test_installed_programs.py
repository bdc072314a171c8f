"""Every program of an installation without extras runs, or names the extra that it needs."""

from __future__ import annotations

import configparser
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
RUN_ALL = """
import contextlib, io, os, runpy, sys

class OnlyTheBase:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] not in {"drone_mesh", "numpy"} | sys.stdlib_module_names:
            raise ImportError(f"No module named {name!r}", name=name)

sys.meta_path.insert(0, OnlyTheBase())
for program in sys.argv[1:]:
    sys.argv = [program, "--help"]
    said = io.StringIO()
    with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
        try:
            runpy.run_path(program, run_name="__main__")
        except SystemExit as end:
            status = end.code
    print(os.path.basename(program), status, said.getvalue().partition("\\n")[0])
"""


@pytest.mark.skipif(sys.version_info < (3, 10), reason="sys.stdlib_module_names")
def test_each_installed_program_runs_or_names_its_extra_in_a_line():
    settings = configparser.ConfigParser()
    settings.read(ROOT / "setup.cfg")
    scripts = settings["options"]["scripts"].split()
    done = subprocess.run(
        [sys.executable, "-c", RUN_ALL, *scripts],
        cwd=str(ROOT),
        env={"PYTHONPATH": str(ROOT / "src")},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    said = [line.split(" ", 2) for line in done.stdout.splitlines()]
    assert [name for name, *_ in said] == [Path(script).name for script in scripts]
    for name, status, first_line in said:
        if status == "0":
            assert first_line.startswith("usage: "), name
        else:
            assert first_line.endswith(("drone_mesh[lab]'", "drone_mesh[console]'")), first_line
