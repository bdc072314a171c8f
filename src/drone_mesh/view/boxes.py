"""Renders the drones' boxes without a screen (pybullet's software renderer)."""

from __future__ import annotations

from typing import Sequence

import numpy as np
import pybullet
from PIL import Image

from drone_mesh.view.camera import Camera
from drone_mesh.view.palette import rgb
from drone_mesh.view.picture import DronePicture

LIGHT_FROM = (-3.0, -6.0, 12.0)
NOTHING = -1  # pybullet's body number of a pixel that shows no body


def paste_boxes(
    image: Image.Image, camera: Camera, drones: Sequence[DronePicture], scale: float
) -> None:
    """Draw the drones' boxes, `scale` times as large as life, over what is in the image."""
    client = pybullet.connect(pybullet.DIRECT)
    try:
        for drone in drones:
            add_box(client, drone, scale)
        width, height, pixels, _, bodies = pybullet.getCameraImage(
            *camera.size,
            camera.view_matrix(),
            camera.projection_matrix(),
            lightDirection=LIGHT_FROM,
            shadow=0,
            renderer=pybullet.ER_TINY_RENDERER,
            physicsClientId=client,
        )
    finally:
        pybullet.disconnect(physicsClientId=client)
    boxes = np.reshape(bodies, (height, width)) != NOTHING
    colours = np.reshape(pixels, (height, width, 4))[:, :, :3].astype(np.uint8)
    image.paste(Image.fromarray(colours), (0, 0), Image.fromarray(boxes))


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
