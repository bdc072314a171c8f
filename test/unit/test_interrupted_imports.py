"""Ctrl-C while a program imports its modules ends it without a traceback."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from drone_mesh.stopping import INTERRUPTED, run_with_extra

ROOT = Path(__file__).resolve().parents[2]
# Python runs this module, if it is found, before each program.
PRESSES_CTRL_C = """
import os, signal, sys

class PressesCtrlC:
    def find_spec(self, name, path=None, target=None):
        if name == "drone_mesh":
            os.kill(os.getpid(), signal.SIGINT)

sys.meta_path.insert(0, PressesCtrlC())
"""


@pytest.mark.slow
@pytest.mark.parametrize("program", sorted(path.name for path in (ROOT / "nodes").iterdir()))
def test_a_program_says_nothing_on_ctrl_c_during_its_imports(tmp_path: Path, program: str) -> None:
    (tmp_path / "sitecustomize.py").write_text(PRESSES_CTRL_C)
    said = subprocess.run(
        [sys.executable, str(ROOT / "nodes" / program)],
        env={**os.environ, "PYTHONPATH": f"{tmp_path}:{ROOT / 'src'}"},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=False,
    )
    assert (said.returncode, said.stdout) == (-signal.SIGINT, "")


def test_ctrl_c_while_the_packages_of_an_extra_load_ends_the_program_at_once() -> None:
    during = []

    def load():
        during.append(signal.getsignal(signal.SIGINT))
        return lambda: 0

    before = signal.getsignal(signal.SIGINT)
    assert run_with_extra("tool", "lab", load) == 0
    assert during == [signal.SIG_DFL]
    assert signal.getsignal(signal.SIGINT) is before


def test_after_its_imports_a_program_handles_ctrl_c_itself() -> None:
    program = """
import os, signal, sys
from drone_mesh.stopping import ends_as

signal.signal(signal.SIGINT, signal.SIG_DFL)  # as during the imports

@ends_as("tool")
def main():
    os.kill(os.getpid(), signal.SIGINT)
    return 0

sys.exit(main())
"""
    environment = {**os.environ, "PYTHONPATH": str(ROOT / "src")}
    ended = subprocess.run([sys.executable, "-c", program], env=environment, check=False)
    assert ended.returncode == INTERRUPTED
