"""VirtualDrone, its two kinds, and DroneFactory, which makes them (docs/ros.md, "Fleet")."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any, ClassVar, Sequence

from drone_mesh.air.obstacles import Obstacles
from drone_mesh.drone.battery import Crews
from drone_mesh.drone.fence import Fence
from drone_mesh.drone.fleet import MAX_DRONES, StartPlace
from drone_mesh.drone.flight_path import FlightPath, PlanFlight, Vector
from drone_mesh.drone.goal import check_goal
from drone_mesh.drone.roles import Role
from drone_mesh.errors import ConfigurationError, FleetRefused, GoalRefused
from drone_mesh.world.body import BodyLimits
from drone_mesh.world.dynamic_engine import DynamicEngine
from drone_mesh.world.engine import DroneEngine
from drone_mesh.world.worlds import PhysicalWorld, World

HALF_WIDTH_M = 0.15  # from the centre of a drone's box to its corner, plus a margin


class VirtualDrone:
    """A box in a world, flown by its engine. Only DroneFactory, which assigns ids, creates them."""

    role: ClassVar[Role]

    def __init__(
        self,
        world: World,
        place: StartPlace,
        wind: Vector | None = None,
        plan_flight: PlanFlight = FlightPath,
        limits: BodyLimits = BodyLimits(),  # noqa: B008 (frozen)
        crews: Crews | None = None,
    ) -> None:
        """Create a drone on the ground at this place. World's thread.

        With a `wind` (m/s) physics moves it, in a PhysicalWorld; without, it follows its path.
        `plan_flight` plans its flights. `limits` and `crews` as for DynamicEngine.
        """
        self.node_id = place.node_id
        size_m = self.role.size_m
        half_height_m = size_m[2] / 2
        centre = _centre(place)
        self.engine: DroneEngine
        if wind is not None and isinstance(world, PhysicalWorld):
            self.box = world.add_body(size_m, centre, limits.mass_kg)
            self.engine = DynamicEngine(
                world, self.box, centre, half_height_m, wind, limits, plan_flight, crews
            )
        else:
            self.box = world.add_box(size_m, centre)
            self.engine = DroneEngine(world, self.box, centre, half_height_m, plan_flight)


class GatewayDrone(VirtualDrone):
    """Carries a gateway."""

    role = Role.GATEWAY


class RouterDrone(VirtualDrone):
    """Carries a router."""

    role = Role.ROUTER


_KINDS = {kind.role: kind for kind in (GatewayDrone, RouterDrone)}


class DroneFactory:
    """Creates a fleet in a world, adds drones to it and removes them.

    `drones` holds them by id. It is replaced as a whole, so any thread may read it; everything else
    is for the world's thread.
    """

    def __init__(
        self,
        world: World,
        fleet: Sequence[StartPlace],
        wind: Vector | None = None,
        obstacles: Obstacles | None = None,
        cruise_height_m: float = math.inf,
        limits: BodyLimits = BodyLimits(),  # noqa: B008 (frozen)
        crews: Crews | None = None,
    ) -> None:
        """`fleet`: as of `plan_fleet`; `wind`, `limits` and `crews`: as for VirtualDrone.

        The `obstacles` are added to the world too; without them, `cruise_height_m` is the ceiling
        of ordered flights. Raises ConfigurationError if a drone would start in or against an
        obstacle.
        """
        self._world = world
        self._wind = wind
        self._limits, self._crews = limits, crews
        self._obstacles = obstacles or Obstacles((), cruise_m=cruise_height_m)
        self._for_flights = _for_flights(self._obstacles)
        for place in fleet:
            why_not = self._why_not_there(place)
            if why_not:
                raise ConfigurationError(
                    f"drone {place.node_id} would start {why_not}, at x {place.longitude:g} m, "
                    f"y {place.latitude:g} m; move that, or change spacing and gridsize"
                )
        for box in self._obstacles.boxes:
            world.add_obstacle(box)
        self.drones: tuple[VirtualDrone, ...] = tuple(self._make(place) for place in fleet)

    @property
    def fence(self) -> Fence:
        """What all drones keep. Any thread."""
        return self._obstacles.fence

    def keep_to(self, fence: Fence) -> None:
        """Let all drones, and later ones, keep this fence from now on. World's thread."""
        self._obstacles = replace(self._obstacles, fence=fence)
        self._for_flights = _for_flights(self._obstacles)
        for drone in self.drones:
            drone.engine.keep_to(fence)

    def get(self, node_id: int) -> VirtualDrone | None:
        """The present drone with this id; None: there is none. Any thread."""
        return next((drone for drone in self.drones if drone.node_id == node_id), None)

    def add(
        self, role: Role, longitude: float, latitude: float, node_id: int | None = None
    ) -> VirtualDrone:
        """Add a drone on the ground at this position (metres, world frame).

        `node_id` None: the lowest free id. Raises FleetRefused for an id that is taken or invalid,
        a full fleet, and a position that is out of bounds, blocked by an obstacle or taken.
        """
        drones = {drone.node_id: drone for drone in self.drones}
        if len(drones) == MAX_DRONES:
            raise FleetRefused(f"the fleet is full: node ids allow at most {MAX_DRONES} drones")
        lowest_free = min(set(range(MAX_DRONES)) - drones.keys())
        if node_id is None:
            node_id = lowest_free
        if not 0 <= node_id < MAX_DRONES:
            raise FleetRefused(f"invalid drone id {node_id}: must be 0..{MAX_DRONES - 1}")
        if node_id in drones:
            raise FleetRefused(
                f"drone {node_id} exists already; the lowest free id is {lowest_free}"
            )
        place = StartPlace(node_id, role, longitude, latitude)
        self._check_place(place)
        drones[node_id] = self._make(place)
        self.drones = tuple(drones[n] for n in sorted(drones))
        return drones[node_id]

    def check_removal(self, node_id: int) -> VirtualDrone:
        """The drone with this id. Raises FleetRefused if there is none or it must stay.

        The last gateway must stay while there are routers, because nothing else could send them
        orders. Any thread.
        """
        drone = self.get(node_id)
        if drone is None:
            raise FleetRefused(f"drone {node_id} does not exist")
        gateways = [other for other in self.drones if other.role is Role.GATEWAY]
        if gateways == [drone] and len(self.drones) > 1:
            raise FleetRefused(
                f"drone {node_id} is the last gateway: no order would reach a router any more; "
                "add another gateway first, or switch this one off"
            )
        return drone

    def remove(self, node_id: int) -> None:
        """Remove a drone from the world. Raises FleetRefused as `check_removal` does."""
        drone = self.check_removal(node_id)
        self.drones = tuple(other for other in self.drones if other is not drone)
        drone.engine.leave()

    def _make(self, place: StartPlace) -> VirtualDrone:
        def plan(*flight: Any) -> FlightPath | None:
            return self._for_flights[place.role].plan_flight(*flight)

        drone = _KINDS[place.role](self._world, place, self._wind, plan, self._limits, self._crews)
        drone.engine.fence = self.fence
        return drone

    def _check_place(self, place: StartPlace) -> None:
        try:
            check_goal(place.latitude, place.longitude, 0.0)
        except GoalRefused as error:
            raise FleetRefused(f"invalid place: {error}") from None
        why_not = self._why_not_there(place)
        if why_not:
            raise FleetRefused(
                f"invalid place: x {place.longitude:g} m, y {place.latitude:g} m is {why_not}"
            )
        centre = _centre(place)
        for drone in self.drones:
            if math.dist(centre, drone.engine.state.position) < 2 * HALF_WIDTH_M:
                raise FleetRefused(f"invalid place: drone {drone.node_id} is there")

    def _why_not_there(self, place: StartPlace) -> str:
        """Why a drone cannot stand there; empty if it can."""
        obstacles, centre = self._for_flights[place.role], _centre(place)
        why_not = obstacles.fence.why_not(centre)
        return why_not or ("" if obstacles.is_free(centre) else "in or against a box")


def _for_flights(obstacles: Obstacles) -> dict[Role, Obstacles]:
    return {role: obstacles.for_flights(HALF_WIDTH_M, role.size_m[2] / 2) for role in Role}


def _centre(place: StartPlace) -> Vector:
    return place.longitude, place.latitude, place.role.size_m[2] / 2
