"""The drone options of raspberry_router and raspberry_gateway."""

from __future__ import annotations

import argparse
from pathlib import Path

from drone_mesh.drone.engines import GROUND, FlightOptions
from drone_mesh.drone.fence import Fence
from drone_mesh.drone.geodesy import Origin
from drone_mesh.drone.mavlink.limits import FlightLimits, Permissions
from drone_mesh.errors import ConfigurationError, naming_argument


def add_flight_options(parser: argparse.ArgumentParser) -> None:
    limits = FlightLimits()
    group = parser.add_argument_group("drone", "docs/flying.md explains these options.")
    group.add_argument(
        "--drone",
        default=GROUND,
        metavar="ENGINE",
        help="ground: the node stands on the ground; mavlink:/dev/serial0,921600 or "
        "mavlink:udpin:HOST:PORT, udpout:, tcp: an ArduPilot or PX4 autopilot; or "
        "package.module:Class (default: %(default)s)",
    )
    group.add_argument(
        "--origin",
        type=_origin,
        metavar="LAT,LON,ALT",
        help="origin of the common frame: degrees (WGS84), metres above sea level; the same on "
        "every node",
    )
    group.add_argument(
        "--fence",
        type=Path,
        metavar="FILE",
        help="areas that drones stay inside or out of: a QGroundControl plan or GeoJSON, with "
        "--origin, or YAML in metres; the same on every node",
    )
    for name, default, unit, text in (
        ("--max-height", limits.max_height_m, "METRES", "maximum height above home"),
        ("--max-distance", limits.max_distance_m, "METRES", "maximum distance from home"),
        ("--speed", limits.speed_m_s, "M/S", "speed of a flight"),
        (
            "--min-battery",
            limits.min_battery_percent,
            "PERCENT",
            "minimum battery charge for a flight; 0: none",
        ),
        ("--cruise-height", limits.cruise_height_m, "METRES", "height of the lowest layer"),
        ("--layers", limits.layer_m, "METRES", "vertical distance between layers"),
    ):
        help_text = f"{text} (default: %(default)g)"
        group.add_argument(name, type=float, default=default, metavar=unit, help=help_text)
    group.add_argument(
        "--hover",
        type=float,
        metavar="METRES",
        help="height at which a repair ends (default: the height that the drone had before)",
    )
    for name, text in (
        ("--may-arm", "arm the drone for a flight"),
        ("--may-take-off", "take off from the ground"),
        ("--may-change-mode", "switch a drone that holds its position to GUIDED or OFFBOARD"),
    ):
        group.add_argument(name, action="store_true", help=f"allow the program to {text}")
    group.add_argument(
        "--orders-may-take-back",
        type=float,
        metavar="SECONDS",
        help="allow an order to end the LOITER or HOLD that somebody else has chosen, this long "
        "after he did; a repair never does (default: no order does; the pilot chooses GUIDED or "
        "OFFBOARD to give the drone back)",
    )


def flight_options(parsed: argparse.Namespace) -> FlightOptions:
    """The parsed options. Raises ConfigurationError."""
    if parsed.emulated and parsed.drone != GROUND:
        raise ConfigurationError("--drone is for a single node, not for --emulated")
    return FlightOptions(
        drone=parsed.drone,
        fence=_fence(parsed.fence, parsed.origin),
        origin=parsed.origin,
        limits=FlightLimits(
            max_height_m=parsed.max_height,
            max_distance_m=parsed.max_distance,
            speed_m_s=parsed.speed,
            min_battery_percent=parsed.min_battery,
            cruise_height_m=parsed.cruise_height,
            layer_m=parsed.layers,
            hover_m=parsed.hover,
        ),
        permissions=Permissions(
            parsed.may_arm,
            parsed.may_take_off,
            parsed.may_change_mode,
            parsed.orders_may_take_back,
        ),
    )


def _fence(path: Path | None, origin: Origin | None) -> Fence:
    if path is None:
        return Fence()
    from drone_mesh.fence_file import read_fence  # with pymap3d and numpy

    with naming_argument("--fence ", path):
        return read_fence(path, origin)


def _origin(text: str) -> Origin:
    try:
        return Origin.parse(text)
    except ConfigurationError as error:
        raise argparse.ArgumentTypeError(str(error)) from error
