"""The diagrams of the documents show what is declared and what a mesh does."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
NAMES = ("protocol.md", "repair.md", "wire.md")
PAGES = {name: (ROOT / "docs" / name).read_text("utf-8") for name in NAMES}


@pytest.mark.slow
def test_the_diagrams_are_those_of_the_code():
    check = subprocess.run(
        [sys.executable, str(ROOT / "scripts" / "diagrams"), "--check"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert check.returncode == 0, check.stderr


@pytest.mark.parametrize(
    ("page", "arrow"),
    [
        ("protocol.md", "    searching --> awaiting_the_first_answer: heartbeat sent"),
        ("protocol.md", "    2->>1: PRESENT to all"),
        ("protocol.md", "    Note over 2: connected"),
        ("repair.md", "    Note over 2: flight decided"),
        ("wire.md", "| creator | from | type | to | forward | latitude |"),
    ],
)
def test_there_is_a_diagram_of_each_subject(page, arrow):
    assert arrow in PAGES[page]
