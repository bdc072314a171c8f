"""The drones of emulated nodes: on the ground, or simulated MAVLink vehicles that fly."""

from __future__ import annotations

import argparse
import dataclasses
import logging
from dataclasses import dataclass

from drone_mesh.drone.engines import GROUND, MAVLINK, FlightOptions, create_engine
from drone_mesh.drone.geodesy import Origin
from drone_mesh.drone.interfaces import IDroneEngine
from drone_mesh.errors import ConfigurationError
from drone_mesh.raspberry.emulated_air import EmulatedAir

DEMONSTRATION_ORIGIN = Origin(52.0907, 5.1214, 3.0)  # Utrecht; only without --origin
_KINDS = (GROUND, "mavlink", "px4")

_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class FleetOptions:
    """The drones of the emulated nodes."""

    drones: str = GROUND  # one of _KINDS
    ground_stations: tuple[str, ...] = ()  # HOST:PORT


def add_fleet_options(parser: argparse.ArgumentParser) -> None:
    """Add the group to a parser."""
    group = parser.add_argument_group("drones of emulated nodes")
    group.add_argument(
        "--drones",
        choices=_KINDS,
        default=GROUND,
        help="with --emulated: mavlink (ArduPilot) or px4 gives each node a simulated vehicle, "
        "which flies as ordered, as far as --may-... allows (default: %(default)s)",
    )
    group.add_argument(
        "--ground-station",
        action="append",
        default=[],
        metavar="HOST:PORT",
        help="with --drones: also send the reports of the vehicles there, for QGroundControl or "
        "MAVProxy; may be given several times",
    )


def fleet_options(parsed: argparse.Namespace) -> FleetOptions:
    """The parsed options. Raises ConfigurationError."""
    if parsed.drones != GROUND and not parsed.emulated:
        raise ConfigurationError("--drones needs --emulated; use --drone for a real one")
    if parsed.ground_station and parsed.drones == GROUND:
        raise ConfigurationError("--ground-station needs --drones mavlink")
    return FleetOptions(parsed.drones, tuple(parsed.ground_station))


class EmulatedFleet:
    """Engines for the nodes on an emulated air."""

    def __init__(self, fleet: FleetOptions, flight: FlightOptions, air: EmulatedAir) -> None:
        """Start the simulated vehicles, if there are any; `close` ends them."""
        self._air = air
        self._flight = flight
        self._server = None
        if fleet.drones == GROUND:
            return
        # pymavlink takes a second to load on a Raspberry Pi
        from drone_mesh.drone.mavlink.autopilots import ARDUPILOT, PX4
        from drone_mesh.drone.mavlink_vehicle.server import VehicleServer, parse_ground_station

        origin = flight.origin or DEMONSTRATION_ORIGIN
        self._flight = dataclasses.replace(flight, origin=origin)
        homes = [Origin(*origin.to_earth(air.place(node_id))) for node_id in range(air.nodes)]
        stations = [parse_ground_station(text) for text in fleet.ground_stations]
        self._server = VehicleServer(PX4 if fleet.drones == "px4" else ARDUPILOT, homes, stations)
        self._server.start()
        _log.info(
            "%d simulated vehicles; the one of node N has MAVLink system id N + 1; origin %g,%g,%g",
            air.nodes,
            *dataclasses.astuple(origin),
        )

    def engine(self, node_id: int) -> IDroneEngine:
        """The engine of one node. Raises ConfigurationError."""
        flight = self._flight
        if self._server is not None:
            address = self._server.addresses[node_id]
            flight = dataclasses.replace(flight, drone=f"{MAVLINK}{address}")
        return create_engine(node_id, self._air.place(node_id), flight)

    @property
    def origin(self) -> Origin | None:
        """The geographic origin of the drones' frame; None: they have none."""
        return self._flight.origin

    def close(self) -> None:
        """End the simulated vehicles; the engines belong to their nodes."""
        if self._server is not None:
            self._server.close()
