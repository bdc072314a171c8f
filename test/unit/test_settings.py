"""Settings: declared once, with their bounds, help and default."""

from __future__ import annotations

import ast
import enum
import math
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Iterator

import pytest

from drone_mesh.communication.node.node_configuration import NodeConfiguration
from drone_mesh.configuration import SETTINGS
from drone_mesh.errors import ConfigurationError
from drone_mesh.settings import setting, settings_of, with_settings

SOURCE = Path(__file__).resolve().parents[2] / "src" / "drone_mesh"


class Colour(enum.Enum):
    RED = "red"
    BLUE = "blue"


@dataclass(frozen=True)
class Paint:
    layer_m: float = setting(0.5, "metres of paint", "metres", above=0, most=2)
    colour: Colour = setting(Colour.RED, "red or blue")


@dataclass(frozen=True)
class House:
    rooms: int = setting(4, "rooms", "a whole number", least=1, most=9)
    rest_s: float = setting(0.0, "seconds of rest", "seconds", least=5, most=60, zero="none")
    paint: Paint = Paint()
    owner: str = "nobody"  # not a setting


BY_KEY = {one.key: one for one in settings_of(House)}


def test_the_settings_of_a_part_are_those_of_the_whole():
    assert list(BY_KEY) == ["rooms", "rest", "layer", "colour"]
    assert [one.default for one in BY_KEY.values()] == [4, 0.0, 0.5, Colour.RED]
    assert BY_KEY["colour"].words == ("red", "blue")


@pytest.mark.parametrize(
    ("key", "value", "is_allowed"),
    [
        ("rooms", 1, True),
        ("rooms", 9, True),
        ("rooms", 0, False),
        ("rooms", 10, False),
        ("layer", 2.0, True),
        ("layer", 0.0, False),
        ("layer", math.nan, False),
        ("rest", 0.0, True),
        ("rest", 4.0, False),
        ("rest", 5.0, True),
        ("rest", math.nan, False),
    ],
)
def test_a_number_is_within_the_bounds_or_the_zero_that_stands_for_something(
    key, value, is_allowed
):
    assert BY_KEY[key].allows(value) is is_allowed


def test_an_error_says_what_is_expected():
    with pytest.raises(ConfigurationError, match="^invalid rest 4.0: expected seconds, 5..60, or"):
        BY_KEY["rest"].check(4.0)
    expected = {key: one.expected for key, one in BY_KEY.items()}
    assert expected == {
        "rooms": "a whole number, 1..9",
        "rest": "seconds, 5..60, or 0 for none",
        "layer": "metres, above 0, at most 2",
        "colour": "red or blue",
    }
    assert BY_KEY["layer"].help == "metres of paint (above 0, at most 2)"


def test_values_reach_the_part_that_declares_them_and_become_the_defaults_of_a_program():
    house = with_settings(House, {"rooms": 2, "layer_m": 1.0, "colour": "blue"})
    assert house == House(rooms=2, paint=Paint(layer_m=1.0, colour=Colour.BLUE))
    assert [one.default for one in settings_of(house)] == [2, 0.0, 1.0, Colour.BLUE]


def literal_defaults() -> Iterator[tuple[str, object, str]]:
    """Each default that the code spells: for which name, and where."""
    for path in sorted(SOURCE.rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            found: list[tuple[str, ast.expr | None]] = []
            if isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name):
                found.append((node.target.id, node.value))
            elif isinstance(node, ast.FunctionDef):
                named = [*node.args.posonlyargs, *node.args.args]
                both = zip(reversed(named), reversed(node.args.defaults))
                found += [(one.arg, value) for one, value in both]
                found += [(o.arg, v) for o, v in zip(node.args.kwonlyargs, node.args.kw_defaults)]
            elif isinstance(node, ast.Call) and node.args:
                option = getattr(node.args[0], "value", None)
                given = {one.arg: one.value for one in node.keywords}
                if isinstance(option, str) and option.startswith("--"):
                    found.append((option[2:].replace("-", "_"), given.get("default")))
            for name, value in found:
                if isinstance(value, ast.Call) and value.args:  # Field(...), setting(...)
                    value = value.args[0]
                if isinstance(value, ast.Constant) and value.value not in (None, False, True, ""):
                    where = f"{path.relative_to(SOURCE)}:{value.lineno}"
                    yield re.sub("_(m|s)$", "", name), value.value, where


def test_no_default_is_written_twice():
    """A number under one name, except for 0 and 1; and of settings also a word."""
    keys = {*SETTINGS, *(one.key for one in settings_of(NodeConfiguration))}
    places: dict[tuple[str, object], list[str]] = {}
    for key, value, place in literal_defaults():
        is_number = isinstance(value, (int, float)) and value not in (0, 1)
        if is_number or key in keys:
            places.setdefault((key, value), []).append(place)
    assert {("check_period", 10.0), ("send_attempts", 3)} <= places.keys()
    assert {key: where for key, where in places.items() if len(where) > 1} == {}
