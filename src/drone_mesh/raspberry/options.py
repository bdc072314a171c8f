"""The command lines of raspberry_router and raspberry_gateway."""

from __future__ import annotations

import argparse
import os
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Mapping, Sequence

from drone_mesh.arguments import ArgumentParser, decimal, whole
from drone_mesh.channel.antenna import DEBUG_PERIOD_S
from drone_mesh.communication.interfaces import MAX_NODE_ID
from drone_mesh.communication.node.node_configuration import ROUTING_TECHNIQUES, NodeConfiguration
from drone_mesh.communication.repair.strategies import REPAIR_STRATEGIES
from drone_mesh.communication.seals.keys import MeshKey, NodeKeys, read_key_file
from drone_mesh.communication.timing import MIN_REPORT_PERIOD_S
from drone_mesh.drone.engines import FlightOptions
from drone_mesh.drone.goal import check_goal
from drone_mesh.drone.location import Location
from drone_mesh.errors import ConfigurationError, MeshError, naming_argument
from drone_mesh.ground_station.settings import NO_STATIONS, GroundStationSettings
from drone_mesh.internet.http_settings import HttpSettings
from drone_mesh.nrf24.settings import RadioSettings, TxPower
from drone_mesh.raspberry.connection_options import (
    AirOptions,
    MqttOptions,
    add_air_options,
    add_ground_station_options,
    add_http_options,
    add_mqtt_options,
    air_options,
    ground_station_options,
    http_options,
    mqtt_options,
)
from drone_mesh.raspberry.flight_options import add_flight_options, flight_options
from drone_mesh.raspberry.wiring_options import (
    Hardware,
    add_common_options,
    add_wiring_options,
    common_settings,
    wired_hardware,
)
from drone_mesh.settings import settings_of, with_settings

MOST_EMULATED = 17  # as in the field case, and what one machine can emulate
CHECK_DRONE = "check-drone"  # the last argument of raspberry_router
LOG_LEVELS = ("debug", "info", "warning", "error")

OUTDOORS = with_settings(
    NodeConfiguration,
    {
        "clearance_m": 5.0,  # satellite positions are accurate to a few metres
        "range_m": 100.0,  # hardly any loss so near (nrf24/emulator/nrf24_range.csv)
        "report_period_s": MIN_REPORT_PERIOD_S,
    },
)
_BUILT_IN = {"routing": sorted(ROUTING_TECHNIQUES), "repair": sorted(REPAIR_STRATEGIES)}
# How often a packet is tried is for experiments.
NODE_SETTINGS = [one for one in settings_of(OUTDOORS) if one.name != "send_attempts"]


@dataclass(frozen=True)
class Options:
    """The options of one program."""

    node_id: int
    hardware: Hardware
    radio: RadioSettings
    mesh: NodeConfiguration
    location: Location | None  # None: not known
    flight: FlightOptions
    air: AirOptions  # an emulated air that several processes share
    emulated: int  # number of emulated nodes that replace the real one; 0: none
    trace: Path | None  # file for the frames on the emulated air
    log_level: str
    gateway: bool
    http: HttpSettings | None  # None: a router without --http
    keys: MeshKey | NodeKeys | None = None  # None: packets are not sealed
    mqtt: MqttOptions | None = None
    silence_s: float | None = None  # without a request, after which a gateway has no internet
    debug_period_s: float = DEBUG_PERIOD_S  # 0: no such lines
    record: Path | None = None  # of a gateway
    ground_station: GroundStationSettings = NO_STATIONS


def parse_router(
    arguments: Sequence[str] | None = None, environment: Mapping[str, str] = os.environ
) -> Options:
    """The options of raspberry_router; invalid ones end the program with a message."""
    parser = _parser(
        "raspberry_router",
        "A router of the drone mesh: forwards packets over its radio. With check-drone as the last "
        "argument it prints the parameters of the autopilot that make a flight safe, and ends.",
    )
    node = parser.add_mutually_exclusive_group(required=True)
    node.add_argument(
        "--id", type=whole(0, MAX_NODE_ID), help=f"node id, 0..{MAX_NODE_ID}, unique in the mesh"
    )
    _add_emulated(node)
    add_air_options(parser, gateway=False)
    http = parser.add_argument_group("HTTP")
    http.add_argument(
        "--http", action="store_true", help="answer GET /status over HTTP, for raspberry_status"
    )
    add_http_options(http)
    parser.set_defaults(gateway=False)
    return _options(parser, parser.parse_args(arguments), environment)


def parse_gateway(
    arguments: Sequence[str] | None = None, environment: Mapping[str, str] = os.environ
) -> Options:
    """The options of raspberry_gateway; invalid ones end the program with a message."""
    parser = _parser(
        "raspberry_gateway",
        "A gateway of the drone mesh: takes orders over HTTP and sends them over its radio.",
    )
    node = parser.add_mutually_exclusive_group()
    node.add_argument(
        "--id",
        type=whole(0, MAX_NODE_ID),
        default=0,
        help=f"node id, 0..{MAX_NODE_ID}, unique in the mesh (default: %(default)s)",
    )
    _add_emulated(node)
    add_air_options(parser, gateway=True)
    add_http_options(parser.add_argument_group("HTTP"))
    add_mqtt_options(parser)
    add_ground_station_options(parser)
    parser.add_argument(
        "--record",
        type=Path,
        metavar="FILE",
        help="append the state of all nodes and the events to this file once a second, for "
        "'report', 'replay' and experiments",
    )
    parser.set_defaults(gateway=True, http=True)
    return _options(parser, parser.parse_args(arguments), environment)


def _parser(program: str, description: str) -> argparse.ArgumentParser:
    parser = ArgumentParser(
        program,
        description=description,
        epilog="All nodes of a mesh need the same channel, rate, CRC and broadcast mode.",
    )
    add_wiring_options(parser)
    radio = parser.add_argument_group("radio")
    add_common_options(radio)
    radio.add_argument(
        "--power",
        type=int,
        choices=[power.value for power in TxPower],
        default=TxPower.DBM_0.value,
        help="transmit power in dBm, before the amplifier if the module has one; the limit in "
        "Europe is 100 mW (20 dBm) after the amplifier (default: %(default)s)",
    )
    mesh = parser.add_argument_group("mesh")
    add_node_settings(mesh)
    mesh.add_argument(
        "--key-file",
        type=Path,
        metavar="FILE",
        help="file with the keys of this node, accessible only to its owner; raspberry_key makes "
        "one. Without a key, any radio in range can take part and give orders",
    )
    place = parser.add_argument_group(
        "place",
        "Position of a node on the ground, in metres, in the common frame of the drones. Without "
        "it the node reports no position.",
    )
    place.add_argument("--latitude", type=float, help="y in metres")
    place.add_argument("--longitude", type=float, help="x in metres")
    place.add_argument(
        "--height", type=float, default=0.0, help="z in metres (default: %(default)g)"
    )
    add_flight_options(parser)
    parser.add_argument(
        "--trace",
        type=Path,
        metavar="FILE",
        help="with an emulated air: write its last 100,000 frames to this file at the end "
        "(pcapng, for Wireshark)",
    )
    parser.add_argument(
        "--debug",
        type=decimal(0.0, 3600.0),
        default=DEBUG_PERIOD_S,
        metavar="SECONDS",
        help="period of the log line with what a simulated node publishes as NodeDebugInfo, and "
        "the use of the channel; 0 for none (default: %(default)g); the signal USR1 ends and "
        "begins them",
    )
    parser.add_argument(
        "--log-level",
        choices=LOG_LEVELS,
        default="info",
        help="lowest level that is logged (default: %(default)s)",
    )
    return parser


def add_node_settings(group: argparse._ActionsContainer) -> None:
    for one in NODE_SETTINGS:
        default = one.plain_default
        built_in = f"; built in: {', '.join(_BUILT_IN[one.name])}" if one.name in _BUILT_IN else ""
        shown = default if isinstance(default, str) else f"{default:g}"
        group.add_argument(
            f"--{one.key.replace('_', '-')}",
            type=type(default),
            choices=one.words or None,
            default=default,
            metavar=one.what.upper() if one.bounds else None,
            help=f"{one.help}{built_in} (default: {shown})",
        )


def _node_configuration(parsed: argparse.Namespace) -> NodeConfiguration:
    """Raises ConfigurationError."""
    values = {one.name: getattr(parsed, one.key) for one in NODE_SETTINGS}
    configuration = with_settings(NodeConfiguration, values)
    for one in NODE_SETTINGS:
        one.check(values[one.name])
    return configuration


def _add_emulated(node: argparse._MutuallyExclusiveGroup) -> None:
    node.add_argument(
        "--emulated",
        type=whole(2, MOST_EMULATED),
        default=0,
        metavar="N",
        help=f"without hardware: run N nodes (2..{MOST_EMULATED}) on emulated radios, a gateway "
        "(0) and routers in columns; columns after the first are reachable only through others",
    )


def _options(
    parser: argparse.ArgumentParser, parsed: argparse.Namespace, environment: Mapping[str, str]
) -> Options:
    serves = parsed.emulated or getattr(parsed, "emulated_air_serve", None)
    if parsed.trace is not None and not serves:
        parser.error(
            "--trace needs --emulated or, for a gateway, --emulated-air-serve: a real radio cannot "
            "record the frames of others"
        )
    if (parsed.latitude is None) != (parsed.longitude is None):
        parser.error("--latitude and --longitude: give both, or neither")
    for name in () if parsed.http else ("bind", "port", "token_file", "name", "cert", "key"):
        if getattr(parsed, name) != parser.get_default(name):
            parser.error(f"--{name.replace('_', '-')} needs --http")
    location = None
    if parsed.latitude is not None:
        location = Location(parsed.latitude, parsed.longitude, parsed.height)
    try:
        if location is not None:
            check_goal(*location)
        return Options(
            node_id=parsed.id or 0,
            hardware=wired_hardware(parsed),
            radio=replace(common_settings(parsed), power=TxPower(parsed.power)),
            mesh=_node_configuration(parsed),
            location=location,
            flight=flight_options(parsed),
            air=air_options(parsed),
            emulated=parsed.emulated,
            trace=parsed.trace,
            debug_period_s=parsed.debug,
            log_level=parsed.log_level,
            gateway=parsed.gateway,
            http=http_options(parsed, environment) if parsed.http else None,
            keys=_keys(parsed),
            mqtt=mqtt_options(parsed, environment) if parsed.gateway else None,
            silence_s=parsed.silence if parsed.gateway and parsed.internet == "http" else None,
            record=parsed.record if parsed.gateway else None,
            ground_station=ground_station_options(parsed) if parsed.gateway else NO_STATIONS,
        )
    except MeshError as error:
        parser.exit(2, f"{parser.prog}: {error}\n")


def _keys(parsed: argparse.Namespace) -> MeshKey | NodeKeys | None:
    if parsed.key_file is None:
        return None
    with naming_argument("--key-file ", parsed.key_file):
        keys = read_key_file(parsed.key_file)
    if isinstance(keys, MeshKey):
        return keys
    if parsed.emulated or parsed.gateway:
        what = "emulated nodes need" if parsed.emulated else "a gateway needs"
        raise ConfigurationError(
            f"--key-file {parsed.key_file}: {what} the mesh key, not the keys of one node"
        )
    if keys.node != parsed.id:
        raise ConfigurationError(
            f"--key-file {parsed.key_file}: the keys are those of node {keys.node}, not {parsed.id}"
        )
    return keys
