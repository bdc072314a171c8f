"""The commands and the Python code in README and docs work as printed."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from fenced_blocks import PAGES, ROOT, blocks  # noqa: E402

PYTHON = [block for block in blocks("python") if not block.test]


@pytest.mark.slow
@pytest.mark.parametrize(
    "page", sorted({block.page for block in PYTHON}), ids=lambda page: str(page.relative_to(ROOT))
)
def test_the_python_of_a_page_runs_from_top_to_bottom(page, tmp_path):
    code = "".join(block.text for block in PYTHON if block.page == page)
    done = subprocess.run(
        [sys.executable, "-c", code],
        cwd=str(tmp_path),
        env={"PYTHONPATH": str(ROOT / "src")},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    assert done.returncode == 0, done.stdout


@pytest.mark.parametrize(
    "block", [*blocks("bash"), *(b for b in blocks("python") if b.test)], ids=str
)
def test_each_block_of_commands_is_run_by_a_test_or_says_why_not(block):
    assert re.fullmatch(r"simulation|clone|none, \w.+", block.test), block.test


def test_all_commands_are_in_bash_blocks():
    """The test above reads no other blocks. "$ ..." is a session with its output."""
    for page in PAGES:
        opening = None
        for line in page.read_text(encoding="utf-8").splitlines():
            if line.startswith("```"):
                opening = line if opening is None else None
            elif opening == "```":
                words = ("python3 ", "ros", "scripts/", "source ", "PYTHONPATH=")
                assert not line.startswith(words), (page, line)
