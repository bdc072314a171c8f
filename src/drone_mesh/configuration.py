"""The configuration of a simulation: config/factory.yaml, overridden by launch arguments."""

from __future__ import annotations

import difflib
import logging
import random
import reprlib
from pathlib import Path
from typing import Any, Literal, Mapping, get_args

from pydantic import AfterValidator, ConfigDict, Field, ValidationError, field_validator
from pydantic.dataclasses import dataclass
from pydantic.fields import FieldInfo
from typing_extensions import Annotated

from drone_mesh.air.reach import MAX_DISTANCE_M
from drone_mesh.communication.node.named_techniques import DEFAULT_ROUTING
from drone_mesh.communication.repair.options import CLEARANCE_M, DEFAULT_REPAIR
from drone_mesh.communication.timing.mesh_timing import MIN_REPORT_PERIOD_S, MeshTiming
from drone_mesh.drone.fleet import (
    DEFAULT_GRIDSIZE,
    DEFAULT_ROUTERS,
    DEFAULT_SPACING_M,
    MAX_DRONES,
)
from drone_mesh.drone.goal import MAX_HEIGHT_M
from drone_mesh.errors import ConfigurationError
from drone_mesh.yaml_file import read_mapping

MIN_REAL_TIME_FACTOR = 0.001  # one step of the world in 10 s
MAX_REAL_TIME_FACTOR = 1000.0  # above it the steps of the clock are too large
MAX_SEED = 2**32 - 1
RANDOM_SEED = "random"  # requests a new seed although the file has a fixed one

_log = logging.getLogger(__name__)


def _zero_or(lowest: float, highest: float) -> AfterValidator:
    def check(value: float) -> float:
        if value != 0 and not lowest <= value <= highest:
            raise ValueError("out of bounds")
        return value

    return AfterValidator(check)


@dataclass(frozen=True, config=ConfigDict(extra="forbid", str_strip_whitespace=True))
class FactoryConfiguration:
    """Every setting of a simulation; config/factory.yaml documents the same defaults.

    Values may have their own type or be text ("3", "true"), as launch arguments are. Error messages
    quote the descriptions.
    """

    # Seeds everything random; load_configuration chooses one if none is given.
    seed: int = Field(ge=0, le=MAX_SEED, description="a whole number")
    gateways: int = Field(1, ge=0, le=MAX_DRONES, description="a whole number of drones")
    routers: int = Field(
        DEFAULT_ROUTERS, ge=0, le=MAX_DRONES, description="a whole number of drones"
    )
    gridsize: int = Field(
        DEFAULT_GRIDSIZE, ge=1, le=MAX_DRONES, description="a whole number of routers in a row"
    )
    spacing: float = Field(
        DEFAULT_SPACING_M, gt=0, le=1000, description="metres"
    )  # between routers
    gui: bool = Field(False)
    drones: Literal["builtin", "external"] = Field("builtin")  # external: other nodes fly them
    flight: Literal["kinematic", "dynamic"] = Field("kinematic")  # dynamic: physics moves drones
    wind_x: float = Field(0.0, ge=-20, le=20, description="metres per second")
    wind_y: float = Field(0.0, ge=-20, le=20, description="metres per second")
    cruise_height: float = Field(
        MAX_HEIGHT_M, gt=0, le=MAX_HEIGHT_M, description="metres"
    )  # ceiling of ordered flights
    missions: str = Field("", description="the absolute path of a file of missions, or empty")
    mobility: Literal[
        "none", "random_waypoint", "gauss_markov", "group", "patrol", "oval", "eight"
    ] = Field("none")  # how pilots fly the routers
    speed: float = Field(0.3, gt=0, le=20, description="metres per second")  # of mobility
    shape: Literal["quadrocopter", "box"] = Field("quadrocopter")  # how drones are drawn
    real_time_factor: Annotated[float, _zero_or(MIN_REAL_TIME_FACTOR, MAX_REAL_TIME_FACTOR)] = (
        Field(
            1.0,
            description=(
                f"a factor, {MIN_REAL_TIME_FACTOR:g}..{MAX_REAL_TIME_FACTOR:g}, "
                "or 0 for as fast as possible"
            ),
        )
    )
    max_distance: float = Field(MAX_DISTANCE_M, gt=0, le=10_000, description="metres")
    obstacles: str = Field("", description="the absolute path of a file of boxes, or empty")
    # block: a box between two nodes ends their link; wall: it attenuates, by its material
    obstacle_radio: Literal["block", "wall"] = Field("block")
    radio: Literal["virtual", "nrf24"] = Field("virtual")  # nrf24: the driver on emulated chips
    data_rate: Literal["250k", "1M", "2M"] = Field("250k")  # of the channel, with radio nrf24
    # http: gateways also take HTTP orders; mqtt: users' data goes to a broker
    internet: Literal["mock", "http", "mqtt"] = Field("mock")
    broker: str = Field("mqtt://127.0.0.1/simulation", min_length=1, description="mqtt://HOST/MESH")
    key: str = Field("", description="the name of a key file")  # empty: nothing is sealed
    routing: str = Field(
        DEFAULT_ROUTING, min_length=1, description="the name of a routing technique"
    )
    repair: str = Field(DEFAULT_REPAIR, min_length=1, description="the name of a repair strategy")
    clearance: float = Field(CLEARANCE_M, gt=0, le=100, description="metres")  # between drones
    # where a repair ends if a silent drone may still be at the place; see LostPlace
    lost_place: Literal["beside", "above", "below", "exact"] = Field("beside")
    check_period: float = Field(MeshTiming.check_period_s, ge=0.1, le=3600, description="seconds")
    connection_lost_after: Annotated[float, _zero_or(0.1, 3600)] = Field(
        MeshTiming.connection_lost_after_s,
        description="seconds, 0.1..3600, or 0 for those of the routing technique",
    )
    report_period: Annotated[float, _zero_or(MIN_REPORT_PERIOD_S, 3600)] = Field(
        MeshTiming.report_period_s,
        description=f"seconds, {MIN_REPORT_PERIOD_S:g}..3600, or 0 for no reports",
    )
    debug: bool = Field(True)

    @field_validator("*", mode="before")
    @classmethod
    def _not_a_switch_for_a_number(cls, value: object, info: Any) -> object:
        if isinstance(value, bool) and info.field_name not in _SWITCHES:
            raise ValueError("true and false are not numbers")
        return value


_SWITCHES = ("gui", "debug")
_FIELDS: Mapping[str, FieldInfo] = vars(FactoryConfiguration)["__pydantic_fields__"]


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

    for name in values:
        if name not in _FIELDS:
            raise ConfigurationError(f"{where(name)}: unknown key {name}; {_hint(name)}")
    try:
        configuration = FactoryConfiguration(**values)
    except ValidationError as error:
        name = str(error.errors()[0]["loc"][0])
        shown = "(empty)" if values[name] is None else reprlib.repr(values[name])
        raise ConfigurationError(
            f"{where(name)}: invalid {name} {shown}: expected {_allowed(name)}"
        ) from None
    _log.info("random seed: to repeat this run, use seed:=%d", configuration.seed)
    return configuration


def _hint(name: object) -> str:
    close = difflib.get_close_matches(str(name), _FIELDS, n=1)
    return f"did you mean {close[0]}?" if close else f"known are {', '.join(sorted(_FIELDS))}"


def _allowed(name: str) -> str:
    """The allowed values of a key, as text."""
    field = _FIELDS[name]
    if name in _SWITCHES:
        return "true or false"
    words = get_args(field.annotation)
    if words:
        return " or ".join(words)
    text = field.description or ""
    lowest, above, highest = (_bound(field, kind) for kind in ("ge", "gt", "le"))
    if lowest is not None and highest is not None:
        text += f", {lowest:.10g}..{highest:.10g}"
    elif above is not None and highest is not None:
        text += f", above {above:g}, at most {highest:g}"
    return text + (f", or {RANDOM_SEED}" if name == "seed" else "")


def _bound(field: FieldInfo, kind: str) -> float | None:
    """The limit of this kind ("ge", "gt", "le") that the field was declared with."""
    limits = (getattr(limit, kind, None) for limit in field.metadata)
    return next((limit for limit in limits if limit is not None), None)
