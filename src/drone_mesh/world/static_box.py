"""A fixed box in pybullet."""

from __future__ import annotations

import pybullet

from drone_mesh.drone.flight_path import Vector


def add_static_box(client: int, centre: Vector, size: Vector, yaw_rad: float) -> int:
    """Add a fixed box to this pybullet client; returns its body number."""
    shape = pybullet.createCollisionShape(
        pybullet.GEOM_BOX, halfExtents=[edge_m / 2 for edge_m in size], physicsClientId=client
    )
    turned = pybullet.getQuaternionFromEuler((0.0, 0.0, yaw_rad))
    return int(
        pybullet.createMultiBody(
            0.0, shape, basePosition=centre, baseOrientation=turned, physicsClientId=client
        )
    )
