"""The options that connect a node: a shared emulated air, HTTP, MQTT, and ground stations."""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from pathlib import Path
from typing import Mapping, NamedTuple

from drone_mesh.arguments import decimal, is_up_to, whole
from drone_mesh.errors import ConfigurationError, naming_argument
from drone_mesh.ground_station.settings import GroundStationSettings
from drone_mesh.internet import DEFAULT_PORT
from drone_mesh.internet.http_settings import HttpSettings
from drone_mesh.internet.mqtt_topics import PASSWORD_VARIABLE, Broker, parse_broker
from drone_mesh.secret_file import read_secret
from drone_mesh.web import LOOPBACK
from drone_mesh.web.access import access_for
from drone_mesh.web.listening import MAX_PORT, Certificate


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


TOKEN_VARIABLE = "DRONE_MESH_TOKEN"


def add_http_options(http: argparse._ArgumentGroup) -> None:
    http.add_argument(
        "--bind",
        metavar="ADDRESS",
        default=LOOPBACK,
        help="address to listen on; an address that other machines can reach needs a token "
        "(default: %(default)s)",
    )
    http.add_argument(
        "--port",
        type=whole(1, MAX_PORT),
        default=DEFAULT_PORT,
        help="TCP port (default: %(default)s)",
    )
    http.add_argument(
        "--token-file",
        metavar="FILE",
        type=Path,
        help="file with the token that requests must carry, at least 16 characters; without this "
        f"option the environment variable {TOKEN_VARIABLE} is used",
    )
    http.add_argument(
        "--name",
        action="append",
        default=[],
        help="another name by which clients address this machine; may be given several times",
    )
    http.add_argument("--cert", metavar="FILE", type=Path, help="certificate (PEM), for HTTPS")
    http.add_argument(
        "--key", metavar="FILE", type=Path, help="private key of the certificate (PEM)"
    )


def http_options(parsed: argparse.Namespace, environment: Mapping[str, str]) -> HttpSettings:
    """The parsed options. Raises ConfigurationError."""
    token = environment.get(TOKEN_VARIABLE, "")
    if parsed.token_file is not None:
        with naming_argument("--token-file ", parsed.token_file):
            token = read_secret(parsed.token_file, "token")
    try:
        access_for(parsed.bind, token)
    except ConfigurationError as error:
        raise ConfigurationError(f"{error} (--token-file, or {TOKEN_VARIABLE})") from error
    if (parsed.cert is None) != (parsed.key is None):
        raise ConfigurationError("--cert and --key are needed together")
    certificate = None if parsed.cert is None else Certificate(parsed.cert, parsed.key)
    return HttpSettings(parsed.bind, parsed.port, token, tuple(parsed.name), certificate)


@dataclass(frozen=True)
class MqttOptions:
    """The broker of a gateway."""

    broker: Broker
    ca_file: Path | None  # None: the authorities that this machine trusts
    is_internet: bool = False  # without the broker, the gateway says that it has no internet


def add_mqtt_options(parser: argparse.ArgumentParser) -> None:
    group = parser.add_argument_group("MQTT", "docs/data.md explains the topics.")
    group.add_argument(
        "--mqtt",
        metavar="URL",
        help="exchange users' messages with a broker: mqtt://HOST/MESH, or with TLS "
        "mqtts://USER@HOST:PORT/MESH",
    )
    group.add_argument(
        "--mqtt-password-file",
        type=Path,
        metavar="FILE",
        help="file with the password of USER; without this option the environment variable "
        f"{PASSWORD_VARIABLE} is used",
    )
    group.add_argument(
        "--mqtt-ca",
        type=Path,
        metavar="FILE",
        help="certificate (PEM) of the private authority that signed the broker's certificate",
    )
    group.add_argument(
        "--internet",
        choices=("none", "mqtt", "http"),
        default="none",
        help="what tells whether this gateway has internet: while the broker does not answer "
        "(mqtt), or after --silence without a request (http), it says that it has none, and its "
        "routers move to another gateway (default: none, it always says that it has internet)",
    )
    group.add_argument(
        "--silence",
        type=decimal(1.0, 86400.0),
        default=60.0,
        metavar="SECONDS",
        help="of --internet http (default: %(default)g)",
    )


def mqtt_options(parsed: argparse.Namespace, environment: Mapping[str, str]) -> MqttOptions | None:
    """The parsed options. Raises ConfigurationError."""
    if parsed.mqtt is None:
        if parsed.mqtt_password_file is not None or parsed.mqtt_ca is not None:
            raise ConfigurationError("--mqtt-password-file and --mqtt-ca need --mqtt")
        if parsed.internet == "mqtt":
            raise ConfigurationError("--internet mqtt needs --mqtt")
        return None
    password = environment.get(PASSWORD_VARIABLE, "")
    if parsed.mqtt_password_file is not None:
        with naming_argument("--mqtt-password-file ", parsed.mqtt_password_file):
            password = read_secret(parsed.mqtt_password_file, "password")
    broker = parse_broker(parsed.mqtt, password)
    return MqttOptions(broker, parsed.mqtt_ca, is_internet=parsed.internet == "mqtt")


def add_ground_station_options(parser: argparse.ArgumentParser) -> None:
    group = parser.add_argument_group("ground stations", "docs/ground-stations.md explains these.")
    group.add_argument(
        "--ground-station",
        action="append",
        default=[],
        metavar="ADDRESS",
        help="show the nodes to a MAVLink ground station: udp:HOST:14550 sends there; "
        "tcp:ADDRESS:PORT listens there; may be given several times",
    )
    group.add_argument(
        "--ground-station-may-order",
        action="store_true",
        help="take orders from it: go to, hold, return, land",
    )
    group.add_argument(
        "--ground-station-key-file",
        default="",
        metavar="FILE",
        help="file with the passphrase of MAVLink 2 signing, accessible only to its owner; needed "
        "for orders from other machines",
    )
    group.add_argument(
        "--cot",
        action="append",
        default=[],
        metavar="ADDRESS",
        help="send Cursor on Target to udp:ADDRESS:PORT, as for ATAK; may be given several times",
    )


def ground_station_options(parsed: argparse.Namespace) -> GroundStationSettings:
    """The parsed options. Raises ConfigurationError."""
    return GroundStationSettings.parse(
        parsed.ground_station,
        parsed.cot,
        parsed.ground_station_may_order,
        parsed.ground_station_key_file,
    )
