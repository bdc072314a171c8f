"""The options for an emulated air shared by several processes."""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from typing import NamedTuple

from drone_mesh.arguments import is_up_to
from drone_mesh.errors import ConfigurationError
from drone_mesh.web import LOOPBACK
from drone_mesh.web.listening import MAX_PORT


class AirAddress(NamedTuple):
    """The address at which an emulated air is served."""

    host: str
    port: int


@dataclass(frozen=True)
class AirOptions:
    """Whether a node joins a shared emulated air, serves one, or neither."""

    join: AirAddress | None = None
    serve: AirAddress | None = None


def add_air_options(node: argparse._ActionsContainer, gateway: bool) -> None:
    """Add the options to a parser or a group."""
    node.add_argument(
        "--emulated-air",
        metavar="[HOST:]PORT",
        help="without hardware: put this node's radio on the emulated air that another process "
        "serves at this address; the node stands at --latitude and --longitude, by default in "
        "columns by id",
    )
    if gateway:
        node.add_argument(
            "--emulated-air-serve",
            metavar="[HOST:]PORT",
            help="without hardware: run this node on an emulated air, and serve that air to other "
            f"processes; without a password, so only on this machine by default ({LOOPBACK})",
        )


def air_options(parsed: argparse.Namespace) -> AirOptions:
    """The parsed options. Raises ConfigurationError."""
    join = _address("--emulated-air", parsed.emulated_air)
    serve = _address("--emulated-air-serve", getattr(parsed, "emulated_air_serve", None))
    if join is not None and serve is not None:
        raise ConfigurationError("--emulated-air and --emulated-air-serve exclude each other")
    if (join or serve) and parsed.emulated:
        raise ConfigurationError("--emulated has an air of its own: leave --emulated-air out")
    return AirOptions(join, serve)


def _address(option: str, text: str | None) -> AirAddress | None:
    if text is None:
        return None
    host, _, port = text.rpartition(":")
    if not is_up_to(port, MAX_PORT):
        raise ConfigurationError(f"invalid {option} {text!r}: use [HOST:]PORT, as in 9100")
    return AirAddress(host.strip("[]") or LOOPBACK, int(port))
