"""DroneFactory: puts a fleet into a world (docs/protocol.md, "Fleet")."""

from __future__ import annotations

from typing import Iterable

from drone_mesh.air.obstacles import Obstacles
from drone_mesh.drone.fleet import StartPlace, plan_fleet
from drone_mesh.drone.flight_path import FlightPath, PlanFlight, Vector
from drone_mesh.drone.roles import Role
from drone_mesh.errors import ConfigurationError
from drone_mesh.world.drones import GatewayDrone, RouterDrone, VirtualDrone
from drone_mesh.world.interfaces import World

HALF_WIDTH_M = 0.15  # from the middle of a drone's box to its corner, and a little
_KINDS = {Role.GATEWAY: GatewayDrone, Role.ROUTER: RouterDrone}


class DroneFactory:
    """Puts a fleet into a world. `drones[n]` is the drone with node id n."""

    def __init__(
        self,
        world: World,
        gateways: int,
        routers: int,
        gridsize: int,
        spacing: float,
        debug: bool,
        wind: Vector | None = None,
        obstacles: Obstacles | None = None,
    ) -> None:
        """Call in the world's thread. Parameters and errors as for `plan_fleet`.

        `debug`: whether the nodes of the drones publish debug information; `wind`: as VirtualDrone.
        The `obstacles` are put into the world too. Raises ConfigurationError if a drone would start
        in or against one.
        """
        self.debug = debug
        fleet = plan_fleet(gateways, routers, gridsize, spacing)
        plan_flight: PlanFlight = FlightPath
        if obstacles is not None:
            check_starts(fleet, obstacles)
            plan_flight = obstacles.for_flights(HALF_WIDTH_M).plan_flight
            for box in obstacles.boxes:
                world.add_obstacle(box)
        self.drones: tuple[VirtualDrone, ...] = tuple(
            _KINDS[role](world, node_id, longitude, latitude, wind, plan_flight)
            for node_id, role, longitude, latitude in fleet
        )


def check_starts(fleet: Iterable[StartPlace], obstacles: Obstacles) -> None:
    """Raise ConfigurationError if a drone would start in or against an obstacle."""
    free = obstacles.for_flights(HALF_WIDTH_M).is_free
    for node_id, role, longitude, latitude in fleet:
        if not free((longitude, latitude, role.size_m[2] / 2)):
            raise ConfigurationError(
                f"obstacles: drone {node_id} would start in or against a box, at "
                f"x {longitude:g} m, y {latitude:g} m; move the box, or change spacing and gridsize"
            )
