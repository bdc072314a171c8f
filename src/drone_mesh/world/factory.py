"""DroneFactory: puts a fleet into a world (docs/protocol.md, "Fleet")."""

from __future__ import annotations

from drone_mesh.drone.fleet import plan_fleet
from drone_mesh.drone.flight_path import Vector
from drone_mesh.drone.roles import Role
from drone_mesh.world.drones import GatewayDrone, RouterDrone, VirtualDrone
from drone_mesh.world.interfaces import World

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
    ) -> None:
        """Call in the world's thread. Parameters and errors as for `plan_fleet`.

        `debug`: whether the nodes of the drones publish debug information; `wind`: as VirtualDrone.
        """
        self.debug = debug
        self.drones: tuple[VirtualDrone, ...] = tuple(
            _KINDS[role](world, node_id, longitude, latitude, wind)
            for node_id, role, longitude, latitude in plan_fleet(
                gateways, routers, gridsize, spacing
            )
        )
