"""Scenes: what a picture of the world shows, made from the state of a mesh."""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass
from typing import Iterable, Sequence, Tuple

from drone_mesh.drone.flight_path import Vector
from drone_mesh.drone.roles import Role
from drone_mesh.state.condition import Condition, condition_of, find_trouble, summarise
from drone_mesh.state.links import Link, LinkUse, links_by_use, shortest
from drone_mesh.state.model import (
    MeshStatus,
    NodeStatus,
    ObstacleStatus,
    position_is_known,
    waypoints,
)
from drone_mesh.state.observation import DroneView
from drone_mesh.view.palette import LIGHT, Colour

COINCIDENT_M = 0.25  # closer than this, two drones of 0.2 m look like one
MOST_LINKS = 600  # per use: more cannot be told apart
DRONE_WIDTH_M = max(Role.ROUTER.size_m)
HALF_DIAGONAL_M = DRONE_WIDTH_M / math.sqrt(2)
WIDEST_OF_CROWDING = 0.3  # greatest drawn width of a drone, as a share of the drones' distance

Slot = Tuple[int, int]  # number of the node in its group, from 0; size of the group


def fan_out(nodes: Sequence[NodeStatus]) -> dict[int, Slot]:
    """The slot of each node that shares its position, as seen from above, with others."""
    groups: dict[tuple[int, int], list[NodeStatus]] = {}
    for node in nodes:
        if position_is_known(node):
            _group_near(groups, node).append(node)
    return {
        node.id: (number, len(group))
        for group in groups.values()
        if len(group) > 1
        for number, node in enumerate(group)
    }


def fan_offset(slot: Slot, radius: float) -> tuple[float, float]:
    """The offset, right and up, at which discs of this radius in one group do not touch."""
    number, size = slot
    angle = math.pi / 2 - 2 * math.pi * number / size
    distance = 1.15 * radius / math.sin(math.pi / size)
    return (distance * math.cos(angle), distance * math.sin(angle))


def fanned_positions(
    nodes: Sequence[NodeStatus], radius_m: float
) -> dict[int, tuple[float, float, float]]:
    """Where to draw each node, in metres, if it fills a circle of this radius from above."""
    slots = fan_out(nodes)
    positions = {}
    for node in nodes:
        x, y, z = node.position
        right, up = fan_offset(slots[node.id], radius_m) if node.id in slots else (0.0, 0.0)
        positions[node.id] = (x + right, y + up, z)
    return positions


def _group_near(
    groups: dict[tuple[int, int], list[NodeStatus]], node: NodeStatus
) -> list[NodeStatus]:
    """The group whose first node is near; a new one if there is none. One group per cell."""
    x, y = node.position[0], node.position[1]
    column, row = math.floor(x / COINCIDENT_M), math.floor(y / COINCIDENT_M)
    for dx in (0, -1, 1):
        for dy in (0, -1, 1):
            group = groups.get((column + dx, row + dy))
            if group and math.dist(group[0].position[:2], (x, y)) < COINCIDENT_M:
                return group
    return groups.setdefault((column, row), [])


class Shape(enum.Enum):
    """The appearance of drones. The value is used in launch arguments and options."""

    QUADROCOPTER = "quadrocopter"
    BOX = "box"


def shape_named(word: str) -> Shape:
    """The shape with this value; the default for an unknown word."""
    return Shape.BOX if word == Shape.BOX.value else Shape.QUADROCOPTER


@dataclass(frozen=True)
class DronePicture:
    """One drone in a picture."""

    node_id: int
    role: Role
    position: Vector  # of the underside, metres, world frame; finite
    condition: Condition = Condition.CONNECTED
    path: Sequence[Vector] = ()  # remaining waypoints, the goal last; empty: not flying
    slot: Slot | None = None  # among the drones at its position; None: it is the only one

    @property
    def colour(self) -> Colour:
        return LIGHT.of_node(self.role, self.condition)

    def size_m(self, scale: float = 1.0) -> Vector:
        """Edges of its box, along x, y, z."""
        x, y, z = self.role.size_m
        return (x * scale, y * scale, z * scale)

    @property
    def is_flying(self) -> bool:
        """Whether it is on a flight."""
        return bool(self.path)

    def underside(self, scale: float = 1.0) -> Vector:
        """Like `centre`, for the middle of its underside."""
        x, y, z = self.centre(scale)
        return (x, y, z - self.size_m(scale)[2] / 2)

    def centre(self, scale: float = 1.0) -> Vector:
        """Where to draw the centre of its box, `scale` times as large and on the same ground.

        Drones at one position are fanned out around it.
        """
        x, y, z = self.position
        aside_m, ahead_m = fan_offset(self.slot, HALF_DIAGONAL_M * scale) if self.slot else (0, 0)
        return (x + aside_m, y + ahead_m, z + self.size_m(scale)[2] / 2)


@dataclass(frozen=True)
class LinkPicture:
    """A link between two node ids; not drawn if one of them is not shown."""

    start: int
    end: int
    use: LinkUse = LinkUse.KNOWN


@dataclass(frozen=True)
class Scene:
    """Everything that is visible at one moment."""

    drones: Sequence[DronePicture] = ()
    links: Sequence[LinkPicture] = ()
    title: str = ""
    obstacles: Sequence[ObstacleStatus] = ()
    shape: Shape = Shape.QUADROCOPTER

    def points(self) -> list[Vector]:
        """Every point that must be inside the picture."""
        return [drone.position for drone in self.drones] + [
            waypoint for drone in self.drones for waypoint in drone.path
        ]


def crowding_m(drones: Sequence[DronePicture]) -> float:
    """How closely drones are spaced: the median distance to the nearest other one, in metres.

    Infinite for fewer than two drones. A single close pair hardly affects it.
    """
    import numpy as np  # only windows and pictures need it

    positions = np.array([drone.position for drone in drones], dtype=float).reshape(-1, 3)
    if len(positions) < 2:
        return math.inf
    distances_m = np.linalg.norm(positions[:, None] - positions[None, :], axis=2)
    np.fill_diagonal(distances_m, np.inf)
    return float(np.median(distances_m.min(axis=1)))


def drawing_scale(drones: Sequence[DronePicture], wanted: float) -> float:
    """How much to enlarge drones: 1..`wanted`, less where they are crowded.

    At its true size a drone of 0.2 m is a dot in a fleet that spans 100 m.
    """
    return max(1.0, min(wanted, WIDEST_OF_CROWDING * crowding_m(drones) / DRONE_WIDTH_M))


def scene_of(mesh: MeshStatus, lost: Iterable[Link] = (), views: Iterable[DroneView] = ()) -> Scene:
    """All nodes whose position is known, and the links between them.

    `lost` are the recently lost links; `views` have newer positions than `mesh`.
    """
    newer = {view.id: view for view in views}
    shown = [node for node in mesh.nodes if position_is_known(node)]
    slots = fan_out(shown)
    summary = summarise(mesh.nodes, find_trouble(mesh.nodes))
    return Scene(
        drones=[_drone(node, newer.get(node.id, node), slots.get(node.id)) for node in shown],
        links=[
            LinkPicture(*link, use)
            for use, links in links_by_use(shown, lost).items()
            for link in shortest(links, shown, MOST_LINKS)
        ],
        title=f"{mesh.stamp_s:.1f} s: {summary.text}",
        obstacles=mesh.obstacles,
        shape=shape_named(mesh.shape),
    )


def _drone(node: NodeStatus, seen: NodeStatus | DroneView, slot: Slot | None) -> DronePicture:
    return DronePicture(
        node_id=node.id,
        role=Role(node.role),
        position=_vector(seen.position),
        condition=condition_of(node),
        path=[_vector(place) for place in waypoints(seen.path)],
        slot=slot,
    )


def _vector(values: Iterable[float]) -> Vector:
    x, y, z = map(float, values)
    return (x, y, z)
