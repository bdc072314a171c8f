"""The command lines of raspberry_router and raspberry_gateway."""

from __future__ import annotations

import argparse
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Callable, Mapping, Sequence

from drone_mesh.communication.interfaces import MAX_NODE_ID
from drone_mesh.communication.routing import ROUTING_TECHNIQUES, create_routing_technique
from drone_mesh.communication.timing import MeshTiming
from drone_mesh.drone.goal import check_goal
from drone_mesh.drone.interfaces import Location
from drone_mesh.errors import ConfigurationError, MeshError
from drone_mesh.internet import DEFAULT_ADDRESS, DEFAULT_PORT
from drone_mesh.nrf24.gpio import CE_GPIO, IRQ_GPIO
from drone_mesh.nrf24.settings import DATA_RATES, BroadcastMode, RadioSettings
from drone_mesh.web.access import access_for
from drone_mesh.web.listening import MAX_PORT

MOST_EMULATED = 17  # our choice: as many as in the field case, and what one machine carries
TOKEN_VARIABLE = "DRONE_MESH_TOKEN"
LOG_LEVELS = ("debug", "info", "warning", "error")
HIGHEST_GPIO = 27  # of the 40-pin header

_BROADCASTS = {mode.value: mode for mode in BroadcastMode}


@dataclass(frozen=True)
class Hardware:
    """Where the radio is connected."""

    spi: tuple[int, int]  # bus, device
    ce_gpio: int
    irq_gpio: int | None  # None: the radio is polled


@dataclass(frozen=True)
class HttpOptions:
    """Where a gateway takes orders."""

    address: str
    port: int
    token: str  # empty: none


@dataclass(frozen=True)
class Options:
    """What was asked for."""

    node_id: int
    hardware: Hardware
    radio: RadioSettings
    timing: MeshTiming
    routing: str
    location: Location
    emulated: int  # that many emulated nodes instead of the real one; 0: the real one
    trace: Path | None  # where to write what was on the emulated air
    log_level: str
    http: HttpOptions | None  # None: not a gateway


def parse_router(
    arguments: Sequence[str] | None = None, environment: Mapping[str, str] = os.environ
) -> Options:
    """The options of raspberry_router; ends the program, with a reason, if they are wrong."""
    parser = _parser(
        "raspberry_router", "A router of the drone mesh: forwards for others over its radio."
    )
    who = parser.add_mutually_exclusive_group(required=True)
    who.add_argument(
        "--id", type=_whole(0, MAX_NODE_ID), help="node id, 0..253, another one for each node"
    )
    _add_emulated(who)
    return _options(parser, parser.parse_args(arguments), environment)


def parse_gateway(
    arguments: Sequence[str] | None = None, environment: Mapping[str, str] = os.environ
) -> Options:
    """The options of raspberry_gateway; ends the program, with a reason, if they are wrong."""
    parser = _parser(
        "raspberry_gateway",
        "A gateway of the drone mesh: what comes in over HTTP goes out over its radio.",
    )
    who = parser.add_mutually_exclusive_group()
    who.add_argument(
        "--id",
        type=_whole(0, MAX_NODE_ID),
        default=0,
        help="node id, 0..253, another one for each node (default: %(default)s)",
    )
    _add_emulated(who)
    http = parser.add_argument_group("HTTP")
    http.add_argument(
        "--bind",
        metavar="ADDRESS",
        default=DEFAULT_ADDRESS,
        help="address to listen on; any but one of this machine alone needs a token "
        "(default: %(default)s)",
    )
    http.add_argument(
        "--port",
        type=_whole(1, MAX_PORT),
        default=DEFAULT_PORT,
        help="TCP port (default: %(default)s)",
    )
    http.add_argument(
        "--token-file",
        metavar="FILE",
        type=Path,
        help="file with the token that requests must bring, at least 16 characters; without this "
        f"option the environment variable {TOKEN_VARIABLE} is used",
    )
    return _options(parser, parser.parse_args(arguments), environment)


def _parser(program: str, description: str) -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        program,
        description=description,
        epilog="All nodes of a mesh need the same channel, rate, CRC and kind of broadcast.",
    )
    wiring = parser.add_argument_group("wiring")
    wiring.add_argument(
        "--spi",
        type=_spi_device,
        default=(0, 0),
        metavar="BUS.DEVICE",
        help="SPI device, as in /dev/spidevBUS.DEVICE (default: 0.0)",
    )
    wiring.add_argument(
        "--ce",
        type=_whole(0, HIGHEST_GPIO),
        default=CE_GPIO,
        metavar="GPIO",
        help="GPIO of the CE pin (default: %(default)s, which is pin 22 of the header)",
    )
    wiring.add_argument(
        "--irq",
        type=_whole(0, HIGHEST_GPIO),
        metavar="GPIO",
        help=f"GPIO of the IRQ pin, {IRQ_GPIO} for pin 18 of the header "
        "(default: not connected, the radio is polled)",
    )
    radio = parser.add_argument_group("radio")
    radio.add_argument(
        "--channel",
        type=_whole(0, 125),
        default=1,
        help="0..125, at 2400 + CHANNEL MHz (default: %(default)s)",
    )
    radio.add_argument(
        "--rate", choices=DATA_RATES, default="250k", help="bits per second (default: %(default)s)"
    )
    radio.add_argument(
        "--crc",
        type=int,
        choices=(8, 16),
        default=16,
        help="bits; 8 for nodes of 2019 (default: %(default)s)",
    )
    radio.add_argument(
        "--broadcast",
        choices=_BROADCASTS,
        default=BroadcastMode.NO_ACK.value,
        help="how broadcasts are sent; shockburst if one of the nodes has a clone of the chip or "
        "one without the plus (default: %(default)s)",
    )
    mesh = parser.add_argument_group("mesh")
    mesh.add_argument(
        "--check-period",
        type=float,
        default=MeshTiming.check_period_s,
        metavar="SECONDS",
        help="how often routes and connection are looked after (default: %(default)g)",
    )
    mesh.add_argument(
        "--connection-lost-after",
        type=float,
        default=MeshTiming.connection_lost_after_s,
        metavar="SECONDS",
        help="how long without a gateway is an emergency (default: %(default)g)",
    )
    mesh.add_argument(
        "--routing",
        default="child_table_tree",
        help=f"routing technique: {', '.join(sorted(ROUTING_TECHNIQUES))}, or package.module:Class "
        "(default: %(default)s)",
    )
    place = parser.add_argument_group(
        "place", "Where the node stands, in metres, for drones that reckon with it."
    )
    place.add_argument("--latitude", type=float, default=0.0, help="y (default: %(default)g)")
    place.add_argument("--longitude", type=float, default=0.0, help="x (default: %(default)g)")
    place.add_argument("--height", type=float, default=0.0, help="(default: %(default)g)")
    parser.add_argument(
        "--trace",
        type=Path,
        metavar="FILE",
        help="with --emulated: write the last 100,000 frames on the air to this file at the end "
        "(pcapng, for Wireshark)",
    )
    parser.add_argument(
        "--log-level", choices=LOG_LEVELS, default="info", help="(default: %(default)s)"
    )
    return parser


def _add_emulated(who: argparse._MutuallyExclusiveGroup) -> None:
    who.add_argument(
        "--emulated",
        type=_whole(2, MOST_EMULATED),
        default=0,
        metavar="N",
        help=f"no hardware: N nodes (2..{MOST_EMULATED}) in this program on emulated radios, a "
        "gateway (0) and routers in columns; those that are not in the first one can only be "
        "reached through others",
    )


def _options(
    parser: argparse.ArgumentParser, parsed: argparse.Namespace, environment: Mapping[str, str]
) -> Options:
    if parsed.trace is not None and not parsed.emulated:
        parser.error("--trace needs --emulated: a real radio does not hear what others send")
    location = Location(parsed.latitude, parsed.longitude, parsed.height)
    try:
        check_goal(*location)
        create_routing_technique(parsed.routing)
        return Options(
            node_id=parsed.id or 0,
            hardware=Hardware(parsed.spi, parsed.ce, parsed.irq),
            radio=RadioSettings(
                channel=parsed.channel,
                data_rate=DATA_RATES[parsed.rate],
                crc_bytes=parsed.crc // 8,
                broadcast_mode=_BROADCASTS[parsed.broadcast],
            ),
            timing=MeshTiming(parsed.check_period, parsed.connection_lost_after),
            routing=parsed.routing,
            location=location,
            emulated=parsed.emulated,
            trace=parsed.trace,
            log_level=parsed.log_level,
            http=_http_options(parsed, environment) if "bind" in parsed else None,
        )
    except MeshError as error:
        parser.exit(2, f"{parser.prog}: {error}\n")


def _http_options(parsed: argparse.Namespace, environment: Mapping[str, str]) -> HttpOptions:
    token = environment.get(TOKEN_VARIABLE, "")
    if parsed.token_file is not None:
        try:
            token = parsed.token_file.read_text(encoding="utf-8").strip()
        except (OSError, UnicodeDecodeError) as error:
            raise ConfigurationError(f"--token-file {parsed.token_file}: {error}") from error
        if not token:
            raise ConfigurationError(f"--token-file {parsed.token_file}: there is no token in it")
    try:
        access_for(parsed.bind, token)
    except ConfigurationError as error:
        raise ConfigurationError(f"{error} (--token-file, or {TOKEN_VARIABLE})") from error
    return HttpOptions(parsed.bind, parsed.port, token)


def _whole(lowest: int, highest: int) -> Callable[[str], int]:
    def whole(text: str) -> int:
        try:
            number = int(text)
        except ValueError:
            number = lowest - 1
        if not lowest <= number <= highest:
            raise argparse.ArgumentTypeError(
                f"{text!r} is not a whole number of {lowest}..{highest}"
            )
        return number

    return whole


def _spi_device(text: str) -> tuple[int, int]:
    bus, dot, device = text.partition(".")
    if not (dot and bus.isdecimal() and device.isdecimal()):
        raise argparse.ArgumentTypeError(f"{text!r} is not BUS.DEVICE, as in 0.0")
    return int(bus), int(device)
