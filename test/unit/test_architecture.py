"""docs/architecture.md shows what the import contracts in pyproject.toml say."""

from __future__ import annotations

import ast
import re
from collections import Counter
from pathlib import Path

import pytest

tomllib = pytest.importorskip("tomllib", reason="part of Python from 3.11 on")

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
SETTINGS = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
CONTRACTS = SETTINGS["tool"]["importlinter"]["contracts"]


def floors_on_the_page(heading):
    """The rooms of each floor, the highest first, of the table with this heading."""
    table = PAGE.partition(f"| floor | {heading} |\n|---|---|\n")[2].partition("\n\n")[0]
    rows = [re.fullmatch(r"\| (\d+) \| (.+) \|", row).groups() for row in table.splitlines()]
    assert [int(number) for number, _rooms in rows] == list(range(len(rows), 0, -1))
    return [sorted(re.findall(r"`(\w+)`", rooms)) for _number, rooms in rows]


def floors_in_the_contract(package):
    (contract,) = (c for c in CONTRACTS if c.get("containers") == [package])
    return [sorted(layer.split(" | ")) for layer in contract["layers"]]


@pytest.mark.parametrize(
    ("heading", "package"),
    [
        ("rooms", "drone_mesh"),
        ("rooms of `ros`", "drone_mesh.ros"),
        ("rooms of `communication`", "drone_mesh.communication"),
    ],
)
def test_the_floors_of_the_page_are_those_of_the_contracts(heading, package):
    assert floors_on_the_page(heading) == floors_in_the_contract(package)


def test_the_page_lists_the_other_contracts_by_their_names():
    names = [c["name"] for c in CONTRACTS if c["type"] == "forbidden"]
    listed = PAGE.partition("Further contracts:\n\n")[2].partition("\n\n")[0]
    assert listed.splitlines() == [f"* {name}" for name in names]


def test_each_room_is_described():
    described = set(re.findall(r"`([\w/]+)`", "".join(re.findall(r"\n\| (`[^|]*) \|", PAGE))))
    rooms = [room for floor in floors_in_the_contract("drone_mesh") for room in floor]
    parts = [f"ros/{room}" for floor in floors_in_the_contract("drone_mesh.ros") for room in floor]
    assert set(rooms) - {"ros"} | set(parts) <= described


def test_each_room_has_a_floor():
    """import-linter checks this as well, but not on Python 3.8 to 3.10."""
    package = ROOT / "src" / "drone_mesh"
    rooms = {path.stem for path in package.glob("*.py")} | {
        path.parent.name for path in package.glob("*/__init__.py")
    }
    floors = {room for floor in floors_in_the_contract("drone_mesh") for room in floor}
    assert rooms - {"__init__", "msg", "srv"} == floors


def test_each_room_of_the_mesh_has_a_floor():
    package = ROOT / "src" / "drone_mesh" / "communication"
    rooms = {path.parent.name for path in package.glob("*/__init__.py")}
    floors = {
        room for floor in floors_in_the_contract("drone_mesh.communication") for room in floor
    }
    assert rooms <= floors
    assert {name for name in floors if not (package / name).is_dir()} <= {
        path.stem for path in package.glob("*.py")
    }


def test_each_room_of_the_mesh_says_what_it_decides():
    package = ROOT / "src" / "drone_mesh" / "communication"
    for path in package.glob("*/__init__.py"):
        text = path.read_text(encoding="utf-8")
        assert 3 <= len(text.splitlines()) <= 8, path
        assert re.search(r"Decides|[Dd]ecides", text), path


def test_the_tests_of_a_room_of_the_mesh_lie_in_its_folder():
    mesh = ROOT / "src" / "drone_mesh" / "communication"
    modules = [path for path in mesh.glob("*/*.py") if path.stem != "__init__"]
    names = Counter(path.stem for path in modules)
    room_of = {path.stem: path.parent.name for path in modules if names[path.stem] == 1}
    tests = ROOT / "test" / "unit" / "communication"
    for path in tests.rglob("test_*.py"):
        room = path.relative_to(tests).parts[0]
        if path.parent == tests:  # of a room that is one module
            assert (mesh / room[len("test_") :]).is_file(), path
            continue
        assert (mesh / room).is_dir(), path
        assert room_of.get(path.stem[len("test_") :], room) == room, path


def test_no_module_gives_a_name_twice():
    """The later value would count everywhere, also above it."""
    twice = []
    for file in sorted((ROOT / "src" / "drone_mesh").rglob("*.py")):
        names = []
        for node in ast.parse(file.read_text(encoding="utf-8")).body:
            targets = node.targets if isinstance(node, ast.Assign) else []
            targets = [node.target] if isinstance(node, ast.AnnAssign) else targets
            names += [target.id for target in targets if isinstance(target, ast.Name)]
        twice += [f"{file.name}: {name}" for name, times in Counter(names).items() if times > 1]
    assert twice == []
