"""VirtualDrone and its two kinds: body and engine (docs/ros.md, "World and flights")."""

from __future__ import annotations

from typing import ClassVar

from drone_mesh.drone.flight_path import FlightPath, PlanFlight, Vector
from drone_mesh.drone.roles import Role
from drone_mesh.world.body import BodyLimits
from drone_mesh.world.bullet_world import BulletWorld
from drone_mesh.world.dynamic_engine import DynamicEngine
from drone_mesh.world.engine import DroneEngine
from drone_mesh.world.interfaces import World


class VirtualDrone:
    """A box in a world, flown by its engine. Only DroneFactory, which assigns ids, creates them."""

    ROLE: ClassVar[Role]

    def __init__(
        self,
        world: World,
        node_id: int,
        longitude: float,
        latitude: float,
        wind: Vector | None = None,
        plan_flight: PlanFlight = FlightPath,
    ) -> None:
        """Create a drone on the ground at this position (metres, world frame). World's thread.

        With a `wind` (m/s) physics moves it, in a BulletWorld; without, it follows its path.
        `plan_flight` plans its flights.
        """
        half_height_m = self.ROLE.size_m[2] / 2
        centre = (longitude, latitude, half_height_m)
        self.node_id = node_id
        self.engine: DroneEngine
        if wind is not None and isinstance(world, BulletWorld):
            self.box = world.add_body(self.ROLE.size_m, centre, BodyLimits().mass_kg)
            self.engine = DynamicEngine(
                world, self.box, centre, half_height_m, wind, plan_flight=plan_flight
            )
        else:
            self.box = world.add_box(self.ROLE.size_m, centre)
            self.engine = DroneEngine(world, self.box, centre, half_height_m, plan_flight)


class GatewayDrone(VirtualDrone):
    """Carries a gateway."""

    ROLE = Role.GATEWAY


class RouterDrone(VirtualDrone):
    """Carries a router."""

    ROLE = Role.ROUTER
