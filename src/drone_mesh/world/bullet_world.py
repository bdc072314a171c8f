"""BulletWorld: ground, gravity, bodies and time in pybullet."""

from __future__ import annotations

from typing import Sequence

import pybullet

from drone_mesh.air.obstacles import Box
from drone_mesh.drone.battery import GRAVITY_M_S2
from drone_mesh.drone.flight_path import Vector
from drone_mesh.errors import ConfigurationError
from drone_mesh.world.worlds import PhysicalWorld

UPRIGHT = (0.0, 0.0, 0.0, 1.0)  # unit quaternion, pybullet's order x y z w
KINEMATIC = 0.0  # physics never moves a body of mass 0


def connect() -> int:
    """A new pybullet client, in which nothing is drawn. Raises ConfigurationError."""
    client: int = pybullet.connect(pybullet.DIRECT)
    if client < 0:
        raise ConfigurationError("pybullet has no room for another world: close one first")
    return client


def add_static_box(client: int, box: Box) -> int:
    """Add a fixed box to this pybullet client; returns its body number."""
    turned = pybullet.getQuaternionFromEuler((0.0, 0.0, box.yaw_rad))
    return _add(client, KINEMATIC, _box_shape(client, box.size), box.center, turned)


def _add(
    client: int, mass_kg: float, shape: int, centre: Vector, turned: Sequence[float] = UPRIGHT
) -> int:
    return int(
        pybullet.createMultiBody(
            mass_kg,
            shape,
            basePosition=centre,
            baseOrientation=turned,
            physicsClientId=client,
        )
    )


def _box_shape(client: int, size: Vector) -> int:
    halves = [edge_m / 2 for edge_m in size]
    return int(
        pybullet.createCollisionShape(pybullet.GEOM_BOX, halfExtents=halves, physicsClientId=client)
    )


class BulletWorld(PhysicalWorld):
    """A separate pybullet world; one process can have several.

    Nothing is drawn. The ground plane is at z = 0. Each pybullet call names this world's client.
    """

    def __init__(self) -> None:
        super().__init__()
        self.client = connect()
        self._shapes: dict[Vector, int] = {}  # by size
        self._moved: set[int] = set()  # bodies that physics moves; without any it has nothing to do
        pybullet.setTimeStep(self.tick_s, physicsClientId=self.client)
        pybullet.setGravity(0.0, 0.0, -GRAVITY_M_S2, physicsClientId=self.client)
        plane = pybullet.createCollisionShape(pybullet.GEOM_PLANE, physicsClientId=self.client)
        self.ground = pybullet.createMultiBody(KINEMATIC, plane, physicsClientId=self.client)

    def step(self) -> float:
        now_s = super().step()
        if self._moved:
            pybullet.stepSimulation(physicsClientId=self.client)
        return now_s

    def add_box(self, size: Vector, centre: Vector) -> int:
        return _add(self.client, KINEMATIC, self._shape(size), centre)

    def add_obstacle(self, box: Box) -> None:
        add_static_box(self.client, box)

    def move_box(self, box: int, centre: Vector) -> None:
        pybullet.resetBasePositionAndOrientation(box, centre, UPRIGHT, physicsClientId=self.client)

    def remove_box(self, box: int) -> None:
        self._moved.discard(box)
        pybullet.removeBody(box, physicsClientId=self.client)

    def add_body(self, size: Vector, centre: Vector, mass_kg: float) -> int:
        body = _add(self.client, mass_kg, self._shape(size), centre)
        self._moved.add(body)
        pybullet.changeDynamics(
            body,
            -1,
            localInertiaDiagonal=(0.0, 0.0, 0.0),  # nothing turns it
            linearDamping=0.0,  # our controller computes the drag
            angularDamping=0.0,
            restitution=0.1,
            physicsClientId=self.client,
        )
        return body

    def body_state(self, body: int) -> tuple[Vector, Vector]:
        position, _ = pybullet.getBasePositionAndOrientation(body, physicsClientId=self.client)
        velocity, _ = pybullet.getBaseVelocity(body, physicsClientId=self.client)
        return position, velocity

    def push(self, body: int, force: Vector, centre: Vector) -> None:
        pybullet.applyExternalForce(
            body, -1, force, centre, pybullet.WORLD_FRAME, physicsClientId=self.client
        )

    def close(self) -> None:
        if self.client >= 0:
            pybullet.disconnect(physicsClientId=self.client)
            self.client = -1

    def _shape(self, size: Vector) -> int:
        """The collision shape of a box; boxes of equal size share it."""
        if size not in self._shapes:
            self._shapes[size] = _box_shape(self.client, size)
        return self._shapes[size]
