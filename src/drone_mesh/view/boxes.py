"""Renders the drones' boxes without a screen (pybullet's software renderer)."""

from __future__ import annotations

from typing import Sequence

import numpy as np
import pybullet
from PIL import Image

from drone_mesh.state.model import ObstacleStatus
from drone_mesh.view.camera import Camera
from drone_mesh.view.palette import LIGHT, rgb
from drone_mesh.view.picture import DronePicture

LIGHT_FROM = (-3.0, -6.0, 12.0)
OBSTACLE_OPACITY = 0.7
NOTHING = -1  # pybullet's body number of a pixel that shows no body


def paste_boxes(
    image: Image.Image,
    camera: Camera,
    drones: Sequence[DronePicture],
    scale: float,
    obstacles: Sequence[ObstacleStatus] = (),
) -> None:
    """Draw the drones' boxes, `scale` times as large as life, over what is in the image.

    Obstacles dim what is behind them.
    """
    client = pybullet.connect(pybullet.DIRECT)
    try:
        for drone in drones:
            add_box(client, drone, scale)
        colours, bodies = _shoot(client, camera)
        image.paste(colours, (0, 0), _mask(bodies != NOTHING, 1.0))
        if obstacles:
            added = [add_obstacle(client, box) for box in obstacles]
            colours, bodies = _shoot(client, camera)
            image.paste(colours, (0, 0), _mask(np.isin(bodies, added), OBSTACLE_OPACITY))
    finally:
        pybullet.disconnect(physicsClientId=client)


def _shoot(client: int, camera: Camera) -> tuple[Image.Image, np.ndarray]:
    """What the camera sees of this pybullet client, and (height, width) which body is where."""
    width, height, pixels, _, bodies = pybullet.getCameraImage(
        *camera.size,
        camera.view_matrix(),
        camera.projection_matrix(),
        lightDirection=LIGHT_FROM,
        shadow=0,
        renderer=pybullet.ER_TINY_RENDERER,
        physicsClientId=client,
    )
    colours = np.reshape(pixels, (height, width, 4))[:, :, :3].astype(np.uint8)
    return Image.fromarray(colours), np.reshape(bodies, (height, width))


def _mask(where: np.ndarray, opacity: float) -> Image.Image:
    return Image.fromarray(np.where(where, round(255 * opacity), 0).astype(np.uint8))


def add_obstacle(client: int, box: ObstacleStatus) -> int:
    """An obstacle in this pybullet client; returns its body."""
    shape = pybullet.createVisualShape(
        pybullet.GEOM_BOX,
        halfExtents=[edge_m / 2 for edge_m in box.size],
        rgbaColor=(*rgb(LIGHT.obstacle), OBSTACLE_OPACITY),
        specularColor=(0, 0, 0),
        physicsClientId=client,
    )
    turned = pybullet.getQuaternionFromEuler((0.0, 0.0, box.yaw))
    return int(
        pybullet.createMultiBody(0.0, -1, shape, list(box.center), turned, physicsClientId=client)
    )


def add_box(client: int, drone: DronePicture, scale: float) -> int:
    """A drone's box in this pybullet client, `scale` times as large as life; returns its body."""
    shape = pybullet.createVisualShape(
        pybullet.GEOM_BOX,
        halfExtents=[edge_m / 2 for edge_m in drone.size_m(scale)],
        rgbaColor=(*rgb(drone.colour), 1.0),
        specularColor=(0, 0, 0),
        physicsClientId=client,
    )
    return int(
        pybullet.createMultiBody(0.0, -1, shape, drone.centre(scale), physicsClientId=client)
    )
