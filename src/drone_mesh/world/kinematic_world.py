"""KinematicWorld: a world without physics, where pybullet is not installed."""

from __future__ import annotations

import itertools

from drone_mesh.air.obstacles import Box
from drone_mesh.drone.flight_path import Vector
from drone_mesh.world.interfaces import World


class KinematicWorld(World):
    """Time passes and drones follow their paths as in BulletWorld; a body is only its centre."""

    def __init__(self) -> None:
        super().__init__()
        self.centres: dict[int, Vector] = {}  # by handle
        self._handles = itertools.count()

    def add_box(self, size: Vector, centre: Vector) -> int:
        handle = next(self._handles)
        self.centres[handle] = centre
        return handle

    def add_obstacle(self, box: Box) -> None:
        """Does nothing: nothing collides here."""

    def move_box(self, box: int, centre: Vector) -> None:
        self.centres[box] = centre

    def remove_box(self, box: int) -> None:
        del self.centres[box]

    def close(self) -> None:
        """Does nothing: there are no resources."""

    def _advance(self) -> None:
        """Does nothing: there is no physics."""
