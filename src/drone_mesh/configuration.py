"""The configuration of a simulation: config/factory.yaml and the launch arguments over it."""

from __future__ import annotations

import difflib
import logging
import math
import random
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, Callable, Mapping, NamedTuple

from drone_mesh.air.reach import MAX_DISTANCE_M
from drone_mesh.errors import ConfigurationError
from drone_mesh.yaml_file import read_mapping

MAX_SEED = 2**32 - 1
RANDOM_SEED = "random"  # asks for a new seed where the file has a fixed one

_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class FactoryConfiguration:
    """Everything a simulation can be told; config/factory.yaml documents the same defaults."""

    seed: int  # of everything random; load_configuration chooses one where none is given
    gateways: int = 1
    routers: int = 17
    gridsize: int = 6  # routers in a row
    spacing: float = 1.0  # metres between routers
    gui: bool = False
    real_time_factor: float = 1.0  # 0: as fast as possible
    max_distance: float = MAX_DISTANCE_M  # metres; in range is nearer than this
    radio: str = "virtual"  # or "nrf24": the real driver on emulated chips
    internet: str = "mock"  # or "http": gateways also take orders over HTTP
    routing: str = "child_table_tree"
    check_period: float = 10.0  # seconds
    connection_lost_after: float = 30.0  # seconds
    debug: bool = True


def load_configuration(
    path: str | Path, overrides: Mapping[str, object] | None = None
) -> FactoryConfiguration:
    """The configuration in this file, overruled key by key.

    An override that is an empty string means "as in the file". Values may be what YAML or ROS made
    of them or plain text ("3", "true"). Where no seed is given, one is chosen; it is logged anyway.
    Raises ConfigurationError (one line: where, key, value, what is allowed).
    """
    given = {
        name: value
        for name, value in (overrides or {}).items()
        if not (isinstance(value, str) and not value.strip())
    }
    from_file = read_mapping(path)
    values: dict[str, Any] = {}
    for source, content in ((f"{path}", from_file), ("argument", given)):
        for name, value in content.items():
            values[name] = _checked(source, name, value)
    if values.get("seed") is None:
        values["seed"] = random.SystemRandom().randrange(MAX_SEED + 1)
    _log.info("seed %d: seed:=%d repeats this run", values["seed"], values["seed"])
    return FactoryConfiguration(**values)


class _Rule(NamedTuple):
    """What a key may be."""

    allowed: str  # for people
    convert: Callable[[object], object]  # the value; raises ValueError where that is not allowed


def _number(value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float, str)):
        raise ValueError
    number = float(value)
    if not math.isfinite(number):
        raise ValueError
    return number


def _whole(lowest: int, highest: int, what: str) -> _Rule:
    def convert(value: object) -> int:
        number = _number(value)
        if number != int(number) or not lowest <= number <= highest:
            raise ValueError
        return int(number)

    return _Rule(f"{what}, {lowest}..{highest}", convert)


def _at_least(lowest: float, highest: float, unit: str) -> _Rule:
    def convert(value: object) -> float:
        number = _number(value)
        if not lowest <= number <= highest:
            raise ValueError
        return number

    return _Rule(f"{unit}, {lowest:g}..{highest:g}", convert)


def _above_zero(highest: float, unit: str) -> _Rule:
    def convert(value: object) -> float:
        number = _number(value)
        if not 0 < number <= highest:
            raise ValueError
        return number

    return _Rule(f"{unit}, above 0, at most {highest:g}", convert)


def _switch(value: object) -> bool:
    word = str(value).strip().lower()
    if word not in ("true", "false", "1", "0"):  # an argument of 1 reaches us as a number
        raise ValueError
    return word in ("true", "1")


def _name(value: object) -> str:
    if not isinstance(value, str) or not value.strip():
        raise ValueError
    return value.strip()


def _seed(value: object) -> int | None:
    """None: to be chosen."""
    if value is None or value == RANDOM_SEED:
        return None
    number = _number(value)
    if number != int(number) or not 0 <= number <= MAX_SEED:
        raise ValueError
    return int(number)


def _one_of(*words: str) -> _Rule:
    def convert(value: object) -> str:
        word = str(value).strip()
        if word not in words:
            raise ValueError
        return word

    return _Rule(" or ".join(words), convert)


_SWITCH = _Rule("true or false", _switch)
_RULES: dict[str, _Rule] = {
    "gateways": _whole(0, 254, "a whole number of drones"),
    "routers": _whole(0, 254, "a whole number of drones"),
    "gridsize": _whole(1, 254, "a whole number of routers in a row"),
    "spacing": _above_zero(1000.0, "metres"),
    "gui": _SWITCH,
    "real_time_factor": _at_least(0.0, 1000.0, "a factor (0: as fast as possible)"),
    "max_distance": _above_zero(10_000.0, "metres"),
    "radio": _one_of("virtual", "nrf24"),
    "internet": _one_of("mock", "http"),
    "routing": _Rule("the name of a routing technique", _name),
    "check_period": _at_least(0.1, 3600.0, "seconds"),
    "connection_lost_after": _at_least(0.1, 3600.0, "seconds"),
    "debug": _SWITCH,
    "seed": _Rule(f"a whole number, 0..{MAX_SEED}, or {RANDOM_SEED}", _seed),
}
assert set(_RULES) == {key.name for key in fields(FactoryConfiguration)}


def _checked(source: str, name: object, value: object) -> object:
    rule = _RULES.get(str(name))
    if rule is None:
        close = difflib.get_close_matches(str(name), _RULES, n=1)
        hint = f"did you mean {close[0]}?" if close else f"known are {', '.join(sorted(_RULES))}"
        raise ConfigurationError(f"{source}: unknown key {name}; {hint}")
    try:
        return rule.convert(value)
    except (ValueError, OverflowError):
        shown = "nothing" if value is None else repr(value)
        raise ConfigurationError(f"{source}: {name} is {shown}, want {rule.allowed}") from None
