"""The configuration of a simulation: config/factory.yaml, overridden by launch arguments."""

from __future__ import annotations

import difflib
import logging
import random
import reprlib
from dataclasses import MISSING, dataclass
from pathlib import Path
from typing import Any, Literal, Mapping, get_args, get_type_hints

from drone_mesh.arguments import is_decimal
from drone_mesh.communication.node.node_configuration import NodeConfiguration
from drone_mesh.communication.repair.options import RANGE_M
from drone_mesh.drone.fleet import (
    DEFAULT_GRIDSIZE,
    DEFAULT_ROUTERS,
    DEFAULT_SPACING_M,
    MAX_DRONES,
)
from drone_mesh.drone.goal import MAX_HEIGHT_M
from drone_mesh.errors import ConfigurationError
from drone_mesh.nrf24.settings import DEFAULT_RATE
from drone_mesh.settings import Setting, setting, settings_of, with_settings
from drone_mesh.yaml_file import read_mapping

MIN_REAL_TIME_FACTOR = 0.001  # one step of the world in 10 s
MAX_REAL_TIME_FACTOR = 1000.0  # above it the steps of the clock are too large
MAX_SEED = 2**32 - 1
RANDOM_SEED = "random"  # requests a new seed although the file has a fixed one
_SWITCHES = {
    **dict.fromkeys(("true", "yes", "on", "t", "y", "1"), True),
    **dict.fromkeys(("false", "no", "off", "f", "n", "0"), False),
}

# The world decides the range. How often a packet is tried is for experiments.
_NOT_OF_A_SIMULATION = ("range_m", "send_attempts")
_NODE = {
    one.key: one for one in settings_of(NodeConfiguration()) if one.name not in _NOT_OF_A_SIMULATION
}

_log = logging.getLogger(__name__)


def type_of(declared: Setting) -> Any:
    """The type of a setting for pydantic. The words of an Enum are their text."""
    return Literal[declared.words] if declared.words else type(declared.default)


def _with_settings_of_a_node(cls: type) -> type:
    """Declare the settings of a node as well."""
    for key, one in _NODE.items():
        cls.__annotations__[key] = type_of(one)
        setattr(cls, key, one.plain_default)
    return cls


@dataclass(frozen=True)
@_with_settings_of_a_node
class FactoryConfiguration:
    """Every setting of a simulation, with those of NodeConfiguration.

    Values may have their own type or be text ("3", "true"), as launch arguments are. Raises
    ConfigurationError.
    """

    seed: int = setting(
        MISSING,  # load_configuration chooses one
        "seed of all random choices; random: a new seed, which the log shows",
        "a whole number",
        least=0,
        most=MAX_SEED,
    )
    gateways: int = setting(
        1,
        "number of gateways; they start at x = -1 m, 1 m apart along y",
        "a whole number of drones",
        least=0,
        most=MAX_DRONES,
    )
    routers: int = setting(
        DEFAULT_ROUTERS,
        f"number of routers; at most {MAX_DRONES} drones in total",
        "a whole number of drones",
        least=0,
        most=MAX_DRONES,
    )
    gridsize: int = setting(
        DEFAULT_GRIDSIZE,
        "number of routers in a row of the start grid, along x from (0, 0)",
        "a whole number of routers in a row",
        least=1,
        most=MAX_DRONES,
    )
    spacing: float = setting(
        DEFAULT_SPACING_M,
        "metres between routers in the start grid",
        "metres",
        above=0,
        most=1000.0,
    )
    gui: bool = setting(
        False, "true or false: whether to open a window on the world (needs a screen)"
    )
    drones: Literal["builtin", "external"] = setting(
        "builtin",
        "builtin: the world flies the drones; external: other nodes fly them "
        "(docs/flying.md, Other engines)",
    )
    flight: Literal["kinematic", "dynamic"] = setting(
        "kinematic",
        "kinematic: drones follow their path exactly; dynamic: physics moves them, with mass, "
        "drag, battery and collisions",
    )
    wind_x: float = setting(
        0.0,
        "wind along x in metres per second, with flight dynamic",
        "metres per second",
        least=-20.0,
        most=20.0,
    )
    wind_y: float = setting(
        0.0,
        "wind along y in metres per second, with flight dynamic",
        "metres per second",
        least=-20.0,
        most=20.0,
    )
    cruise_height: float = setting(
        MAX_HEIGHT_M, "ceiling of ordered flights in metres", "metres", above=0, most=MAX_HEIGHT_M
    )
    relief: Literal["none", "spare_first", "named_backup", "rotate"] = setting(
        "none",
        "none, spare_first, named_backup or rotate: how drones whose batteries run low are "
        "relieved, with flight dynamic (docs/endurance.md)",
    )
    hover_minutes: float = setting(
        20.0,
        "minutes for which a drone hovers with a full battery, with flight dynamic",
        "minutes",
        above=0,
        most=1000.0,
    )
    swap_time: float = setting(
        60.0,
        "seconds in which a battery is swapped where its drone started, with a relief",
        "seconds",
        above=0,
        most=36_000.0,
    )
    swaps_at_once: int = setting(
        1,
        "number of batteries that are swapped at once",
        "a whole number of batteries",
        least=1,
        most=MAX_DRONES,
    )
    missions: str = setting(
        "",
        "absolute path of a YAML file of missions, which pilots fly; the mesh is not told "
        "(docs/motion.md)",
        "the absolute path of a file of missions, or empty",
    )
    mobility: Literal[
        "none", "random_waypoint", "gauss_markov", "group", "patrol", "oval", "eight"
    ] = setting(
        "none",
        "none, random_waypoint, gauss_markov, group, patrol, oval or eight: how pilots fly the "
        "routers",
    )
    speed: float = setting(
        0.3, "metres per second of mobility", "metres per second", above=0, most=20.0
    )
    shape: Literal["quadrocopter", "box"] = setting(
        "quadrocopter",
        "quadrocopter or box: how the window, snapshots, rviz and the page draw a drone",
    )
    real_time_factor: float = setting(
        1.0,
        "simulated seconds per wall second",
        "a factor",
        least=MIN_REAL_TIME_FACTOR,
        most=MAX_REAL_TIME_FACTOR,
        zero="as fast as possible",
    )
    max_distance: float = setting(
        RANGE_M,
        "range of the radio in metres: nodes closer than this hear each other",
        "metres",
        above=0,
        most=10_000.0,
    )
    obstacles: str = setting(
        "",
        "absolute path of a YAML file of boxes to place in the world; they block or attenuate the "
        "radio, and drones fly over or round them",
        "the absolute path of a file of boxes, or empty",
    )
    fence: str = setting(
        "",
        "absolute path of a file of areas that drones stay inside or out of: YAML in metres, or "
        "with an origin GeoJSON or a QGroundControl plan (docs/flying.md)",
        "the absolute path of a file of areas, or empty",
    )
    obstacle_radio: Literal["block", "wall"] = setting(
        "block",
        "block: a box between two nodes ends their link; wall: it attenuates the link, depending "
        "on its material",
    )
    radio: Literal["virtual", "nrf24"] = setting(
        "virtual",
        "virtual: an ideal disc; nrf24: the real driver on an emulated nRF24L01+ chip per drone",
    )
    data_rate: Literal["250k", "1M", "2M"] = setting(
        DEFAULT_RATE, "250k, 1M or 2M: bits per second of the channel, with radio nrf24"
    )
    internet: Literal["mock", "http", "mqtt"] = setting(
        "mock",
        "mock: gateways take orders from the DroneManager; http: also over HTTP, gateway G on "
        "127.0.0.1, port 9080 + G; mqtt: users' data also goes to the broker",
    )
    broker: str = setting(
        "mqtt://127.0.0.1/simulation",
        "with internet mqtt: mqtt://HOST/MESH or mqtts://USER@HOST:PORT/MESH",
        "mqtt://HOST/MESH",
    )
    key: str = setting(
        "",
        "absolute path of a file with a mesh key (raspberry_key new makes one), which seals all "
        "packets",
        "the name of a key file",
    )
    debug: bool = setting(
        True, "true or false: whether each node publishes /Nodes/ID/debug once per simulated second"
    )

    def __post_init__(self) -> None:
        for name in SETTINGS:
            object.__setattr__(self, name, _checked(name, getattr(self, name)))

    @property
    def node(self) -> NodeConfiguration:
        """The configuration of each node."""
        values = {one.name: getattr(self, key) for key, one in _NODE.items()}
        return with_settings(NodeConfiguration, {**values, "range_m": self.max_distance})


SETTINGS: dict[str, Setting] = {
    **{one.name: one for one in settings_of(FactoryConfiguration)},
    **_NODE,
}
"""By key, in the order of the file."""
_KINDS = get_type_hints(FactoryConfiguration)


def load_configuration(
    path: str | Path, overrides: Mapping[str, object] | None = None
) -> FactoryConfiguration:
    """The configuration in this file, overridden key by key.

    An override that is an empty string keeps the value of the file. If no seed is given, one is
    chosen; the seed is always logged. Raises ConfigurationError (one line: file and line or
    argument, key, value, what is allowed).
    """
    file = read_mapping(path)
    given = {
        name: value
        for name, value in (overrides or {}).items()
        if not (isinstance(value, str) and not value.strip())
    }
    values = {**file.content, **given}
    new_seed = values.get("seed") in (None, RANDOM_SEED)
    if new_seed:
        values["seed"] = random.SystemRandom().randrange(MAX_SEED + 1)

    def where(name: object) -> str:
        return "argument" if name in given else file.where(name)

    for name, value in values.items():
        try:
            _checked(name, value)
        except ConfigurationError as error:
            raise ConfigurationError(f"{where(name)}: {error}") from None
    configuration = FactoryConfiguration(**values)
    _log.info("random seed: to repeat this run, use seed:=%d", configuration.seed)
    return configuration


def _checked(name: str, value: object) -> Any:
    """The value in the type of its key. Raises ConfigurationError."""
    if name not in SETTINGS:
        raise ConfigurationError(f"unknown key {name}; {_hint(name)}")
    declared, kind = SETTINGS[name], _KINDS[name]
    found = _of_kind(kind, value)
    if found is None or not declared.allows(found) or (found == "" and declared.default):
        shown = "(empty)" if value is None else reprlib.repr(value)
        raise ConfigurationError(f"invalid {name} {shown}: expected {_allowed(declared, kind)}")
    return found


def _of_kind(kind: Any, value: object) -> Any:
    """None if the value is not of this kind."""
    text = str(value).strip()
    if kind is bool:
        return _SWITCHES.get(text.lower())
    if kind not in (int, float):
        is_word = isinstance(value, str) and (kind is str or text in get_args(kind))
        return text if is_word else None
    if not is_decimal(text):
        return None
    number = float(text)
    return number if kind is float else int(number) if number.is_integer() else None


def _hint(name: object) -> str:
    close = difflib.get_close_matches(str(name), SETTINGS, n=1)
    return f"did you mean {close[0]}?" if close else f"known are {', '.join(sorted(SETTINGS))}"


def _allowed(declared: Setting, kind: Any) -> str:
    """The allowed values of a key, as text."""
    if kind is bool:
        return "true or false"
    words = " or ".join(get_args(kind)) or declared.expected
    return words + (f", or {RANDOM_SEED}" if declared.name == "seed" else "")
