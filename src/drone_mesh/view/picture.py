"""What a picture of a world shows: drones, links and flights, and their colours."""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass
from typing import Sequence

import numpy as np

from drone_mesh.drone.flight_path import Vector
from drone_mesh.drone.roles import Role
from drone_mesh.world.drones import GatewayDrone, RouterDrone, VirtualDrone
from drone_mesh.world.interfaces import Colour


class DroneCondition(enum.Enum):
    """How the node of a drone is. The value is the word that people see."""

    CONNECTED = "connected"
    LOST = "not connected"
    OFF = "off"
    UNKNOWN = "no report"


class LinkUse(enum.Enum):
    """What a link between two nodes is good for. The value is the word that people see."""

    KNOWN = "neighbours"
    LOST = "just lost"
    ROUTE = "way to a gateway"


KIND_OF_ROLE: dict[Role, type[VirtualDrone]] = {
    Role.GATEWAY: GatewayDrone,
    Role.ROUTER: RouterDrone,
}
CONDITION_COLOURS: dict[DroneCondition, Colour] = {  # a connected drone has the colour of its role
    DroneCondition.LOST: (0.83, 0.18, 0.15, 1.0),
    DroneCondition.OFF: (0.45, 0.48, 0.52, 1.0),
    DroneCondition.UNKNOWN: (0.80, 0.72, 0.45, 1.0),
}
LINK_COLOURS: dict[LinkUse, Colour] = {
    LinkUse.KNOWN: (0.62, 0.67, 0.74, 1.0),
    LinkUse.LOST: (0.83, 0.18, 0.15, 1.0),
    LinkUse.ROUTE: (0.05, 0.50, 0.34, 1.0),
}
PATH_COLOUR: Colour = (0.88, 0.50, 0.0, 1.0)

DRONE_WIDTH_M = max(RouterDrone.SIZE_M)
WIDEST_OF_CROWDING = 0.3  # a drone is drawn at most so wide, as a share of the drones' distance


@dataclass(frozen=True)
class DronePicture:
    """One drone in a picture."""

    node_id: int
    role: Role
    position: Vector  # of the underside, metres, world frame; finite
    condition: DroneCondition = DroneCondition.CONNECTED
    path: Sequence[Vector] = ()  # the rest of its flight, the goal last; empty: it does not fly

    @property
    def colour(self) -> Colour:
        """The colour of its condition; of its role while it is connected."""
        return CONDITION_COLOURS.get(self.condition, KIND_OF_ROLE[self.role].COLOUR)

    def size_m(self, scale: float = 1.0) -> Vector:
        """Edges of its box, along x, y, z."""
        x, y, z = KIND_OF_ROLE[self.role].SIZE_M
        return (x * scale, y * scale, z * scale)

    def centre(self, scale: float = 1.0) -> Vector:
        """The centre of its box, drawn `scale` times as large and standing where it stood."""
        x, y, z = self.position
        return (x, y, z + self.size_m(scale)[2] / 2)


@dataclass(frozen=True)
class LinkPicture:
    """One link between two node ids; it is left out where one of them is not shown."""

    start: int
    end: int
    use: LinkUse = LinkUse.KNOWN


@dataclass(frozen=True)
class Scene:
    """All that is to be seen at one moment."""

    drones: Sequence[DronePicture] = ()
    links: Sequence[LinkPicture] = ()
    title: str = ""

    def points(self) -> list[Vector]:
        """Every place that has to be in the picture."""
        return [drone.position for drone in self.drones] + [
            corner for drone in self.drones for corner in drone.path
        ]


def crowding_m(drones: Sequence[DronePicture]) -> float:
    """How near to each other drones stand: the median distance to the nearest other one, in metres.

    Infinite for less than two drones. A pair that stands closer than everybody else hardly counts.
    """
    places = np.array([drone.position for drone in drones], dtype=float).reshape(-1, 3)
    if len(places) < 2:
        return math.inf
    distances_m = np.linalg.norm(places[:, None] - places[None, :], axis=2)
    np.fill_diagonal(distances_m, np.inf)
    return float(np.median(distances_m.min(axis=1)))


def drawing_scale(drones: Sequence[DronePicture], wanted: float) -> float:
    """How many times too large to draw drones: 1..`wanted`, less where they stand close together.

    A drone of 0.2 m is a dot in a fleet of 100 m, and a picture is there to be seen.
    """
    return max(1.0, min(wanted, WIDEST_OF_CROWDING * crowding_m(drones) / DRONE_WIDTH_M))
