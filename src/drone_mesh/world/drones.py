"""VirtualDrone, its two kinds: size, colour, engine (docs/protocol.md, "World and flights")."""

from __future__ import annotations

from typing import ClassVar

from drone_mesh.drone.flight_path import Vector
from drone_mesh.drone.roles import Role
from drone_mesh.world.engine import DroneEngine
from drone_mesh.world.interfaces import Colour, World


class VirtualDrone:
    """A box in a world that its engine flies. Only DroneFactory makes them: it alone gives ids."""

    ROLE: ClassVar[Role]
    SIZE_M: ClassVar[Vector]  # edges along x, y, z
    COLOUR: ClassVar[Colour]

    def __init__(self, world: World, node_id: int, longitude: float, latitude: float) -> None:
        """Stands on the ground at this place (metres, world frame). Call in the world's thread."""
        half_height_m = self.SIZE_M[2] / 2
        centre = (longitude, latitude, half_height_m)
        self.node_id = node_id
        self.box = world.add_box(self.SIZE_M, self.COLOUR, centre)
        self.engine = DroneEngine(world, self.box, centre, half_height_m)


class GatewayDrone(VirtualDrone):
    """Carries a gateway."""

    ROLE = Role.GATEWAY
    SIZE_M = (0.2, 0.1, 0.2)
    COLOUR = (0.56, 0.20, 0.75, 1.0)  # purple


class RouterDrone(VirtualDrone):
    """Carries a router."""

    ROLE = Role.ROUTER
    SIZE_M = (0.2, 0.2, 0.1)
    COLOUR = (0.16, 0.65, 0.27, 1.0)  # green
