"""The MQTT options of raspberry_gateway."""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from pathlib import Path
from typing import Mapping

from drone_mesh.arguments import decimal
from drone_mesh.errors import ConfigurationError, naming_argument
from drone_mesh.internet.mqtt_topics import PASSWORD_VARIABLE, Broker, parse_broker
from drone_mesh.secret_file import read_secret


@dataclass(frozen=True)
class MqttOptions:
    """The broker of a gateway."""

    broker: Broker
    ca_file: Path | None  # None: the authorities that this machine trusts
    is_internet: bool = False  # without the broker, the gateway says that it has no internet


def add_mqtt_options(parser: argparse.ArgumentParser) -> None:
    """Add the group to a parser."""
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
