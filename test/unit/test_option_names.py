"""No option of a program and no argument of a launch file is without a test that sets it."""

from __future__ import annotations

import argparse
import ast
import re
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Iterator

import pytest

from drone_mesh.raspberry.flight_options import add_flight_options
from drone_mesh.raspberry.options import add_node_settings

ROOT = Path(__file__).resolve().parents[2]
SOURCE, LAUNCH = ROOT / "src" / "drone_mesh", ROOT / "launch"
KINDS = (".py", ".test", ".launch")
TESTS = "\n".join(
    path.read_text(encoding="utf-8")
    for path in sorted((ROOT / "test").rglob("*"))
    if path.suffix in KINDS and path != Path(__file__)
)
GIVEN = set(re.findall(r"(?<![\w-])-[\w-]+", TESTS))


def options() -> Iterator[tuple[str, list[str]]]:
    """Where each option is declared, and its names."""
    for path in sorted(SOURCE.rglob("*.py")):
        text = path.read_text(encoding="utf-8")
        if "add_argument(" not in text:
            continue
        for call in ast.walk(ast.parse(text)):
            if isinstance(call, ast.Call) and getattr(call.func, "attr", "") == "add_argument":
                names = [str(arg.value) for arg in call.args if isinstance(arg, ast.Constant)]
                if names and names[0].startswith("-"):
                    yield f"{path.relative_to(ROOT)}: {names[-1]}", names


def options_from_tables() -> Iterator[tuple[str, list[str]]]:
    """Those that a program for a Raspberry Pi adds in a loop."""
    parser = argparse.ArgumentParser(add_help=False)
    add_node_settings(parser)
    add_flight_options(parser)
    for action in parser._actions:
        yield f"raspberry: {action.option_strings[0]}", list(action.option_strings)


def launch_arguments() -> Iterator[tuple[str, str]]:
    for path in sorted(LAUNCH.glob("*.launch")):
        for argument in ET.parse(path).getroot().findall("arg"):
            if "value" not in argument.attrib:  # what has one cannot be set
                yield path.name, argument.attrib["name"]


@pytest.mark.parametrize(
    ("where", "names"), [pytest.param(*o, id=o[0]) for o in (*options(), *options_from_tables())]
)
def test_a_test_gives_each_option(where: str, names: list[str]) -> None:
    assert GIVEN & set(names), f"{where}: no test gives it"


@pytest.mark.parametrize(("file", "name"), sorted(launch_arguments()))
def test_a_test_sets_each_launch_argument(file: str, name: str) -> None:
    # test_arguments.py passes all settings of the factory and all arguments of the console
    by_name = file in ("factory.launch", "console.launch") and is_passed_on(file, name)
    given = rf'\b{name}:=|<arg name="{name}" value='
    assert by_name or re.search(given, TESTS), f"{file}: no test sets {name}"


def is_passed_on(file: str, name: str) -> bool:
    """Whether it is a parameter of the node that test_arguments.py looks at."""
    node = {"factory.launch": "DroneFactory", "console.launch": "mesh_console"}[file]
    tree = ET.parse(LAUNCH / file)
    found = tree.findall(f".//node[@name='{node}']/param[@name='{name}']")
    return [param.attrib["value"] for param in found] == [f"$(arg {name})"]


def test_scripts_run_takes_every_path_relative_to_the_folder_where_it_is_typed() -> None:
    script = (ROOT / "scripts/run").read_text(encoding="utf-8")
    arguments = ET.parse(LAUNCH / "factory.launch").getroot().iter("arg")
    paths = [one.get("name") for one in arguments if "absolute path" in one.get("doc", "")]
    assert {"fence", "key", "obstacles", "tiles"} <= set(paths)
    assert [name for name in paths if f" {name}:=[!/~]*" not in script] == []
