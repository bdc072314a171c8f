"""VirtualDrone: body and engine (docs/ros.md, "World and flights")."""

from __future__ import annotations

from drone_mesh.drone.fleet import StartPlace
from drone_mesh.drone.flight_path import FlightPath, PlanFlight, Vector
from drone_mesh.world.body import BodyLimits
from drone_mesh.world.bullet_world import BulletWorld
from drone_mesh.world.dynamic_engine import DynamicEngine
from drone_mesh.world.engine import DroneEngine
from drone_mesh.world.interfaces import World


class VirtualDrone:
    """A box in a world, flown by its engine. Only DroneFactory, which assigns ids, creates them."""

    def __init__(
        self,
        world: World,
        place: StartPlace,
        wind: Vector | None = None,
        plan_flight: PlanFlight = FlightPath,
    ) -> None:
        """Create a drone on the ground at this place. World's thread.

        With a `wind` (m/s) physics moves it, in a BulletWorld; without, it follows its path.
        `plan_flight` plans its flights.
        """
        self.node_id, self.role = place.node_id, place.role
        size_m = self.role.size_m
        half_height_m = size_m[2] / 2
        centre = (place.longitude, place.latitude, half_height_m)
        self.engine: DroneEngine
        if wind is not None and isinstance(world, BulletWorld):
            self.box = world.add_body(size_m, centre, BodyLimits().mass_kg)
            self.engine = DynamicEngine(
                world, self.box, centre, half_height_m, wind, plan_flight=plan_flight
            )
        else:
            self.box = world.add_box(size_m, centre)
            self.engine = DroneEngine(world, self.box, centre, half_height_m, plan_flight)
