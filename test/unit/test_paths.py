"""The files and folders that README, CONTRIBUTING, docs and modules name are there."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from fenced_blocks import PAGES, ROOT  # noqa: E402

PACKAGE = ROOT / "src" / "drone_mesh"
FENCED = re.compile(r"^```.*?^```", flags=re.DOTALL | re.MULTILINE)
PATH = re.compile(r"`([\w.-]+(?:/[\w.-]+)*/?)`")
FILE = re.compile(r"\.(?:py|js|launch|html|bash)$")
OF_A_ROOM = re.compile(r"\| `([\w/]+)` \|")  # a row of the table of rooms begins with the room
IN_A_MODULE = re.compile(r"(?<![\w./~-])(?:\w+/)+\w+\.(?:py|md|yaml|launch)\b")
# Made by a user or a run, or not files: packages of ROS, topics of MQTT, templates.
NOT_IN_THE_REPOSITORY = re.compile(
    r"\.+/|\.venv/|logs/|results/|drone_mesh/|half_way\.py$|drone_mesh\.\w+$|.*\bNAME\b"
)


def named_paths(text: str) -> list[tuple[str, str]]:
    """Each path in backticks with the room whose row of a table names it, if one does."""
    found = []
    for line in FENCED.sub("", text).splitlines():
        row = OF_A_ROOM.match(line)
        for path in PATH.findall(line):
            if not NOT_IN_THE_REPOSITORY.match(path) and ("/" in path or FILE.search(path)):
                found.append((path, row[1] if row else ""))
    return found


def is_there(path: str, room: str) -> bool:
    """From the root or from the package; in a room's row also from there; pages by their name."""
    if "/" not in path and not path.endswith(".py"):
        return any(
            any(folder.rglob(path)) for folder in (ROOT / "launch", PACKAGE, ROOT / "scripts")
        )
    return any((start / path).exists() for start in (ROOT, PACKAGE, PACKAGE / room))


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_each_path_that_a_page_names_exists(page):
    named = named_paths(page.read_text(encoding="utf-8"))
    assert [path for path, room in named if not is_there(path, room)] == []


def test_each_path_that_a_module_names_exists():
    """From the root, the package, or a folder above the module."""
    missing = []
    for module in sorted(PACKAGE.rglob("*.py")):
        starts = [
            ROOT,
            *(folder for folder in module.parents if PACKAGE in (folder, *folder.parents)),
        ]
        for path in IN_A_MODULE.findall(module.read_text(encoding="utf-8")):
            if not any((start / path).exists() for start in starts):
                missing.append(f"{module.relative_to(ROOT)}: {path}")
    assert missing == []
