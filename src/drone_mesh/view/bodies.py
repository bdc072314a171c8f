"""Drones and obstacles as bodies of a pybullet client, and an off-screen picture of them."""

from __future__ import annotations

from pathlib import Path
from typing import Sequence

import numpy as np
import pybullet
from PIL import Image

from drone_mesh.state.model import ObstacleStatus
from drone_mesh.view.camera import Camera
from drone_mesh.view.palette import FRAME, LIGHT, Colour, rgb
from drone_mesh.view.quadrocopter import frame_file, lamp_file
from drone_mesh.view.scene import DronePicture, Scene, Shape
from drone_mesh.world.bullet_world import UPRIGHT

MESHES = Path(__file__).with_name("meshes")
LIGHT_FROM = (-3.0, -6.0, 12.0)
OBSTACLE_OPACITY = 0.7
NOTHING = -1  # pybullet's body number for pixels without a body
BASE = -1  # pybullet's number for a body without its links


class Bodies:
    """Creates bodies in one pybullet client; belongs to that client's thread.

    A quadrocopter is one body: its frame is the base, and its lamp, of another colour, is a link.
    """

    def __init__(self, client: int, shape: Shape) -> None:
        self._client = client
        self._shape = shape
        self._shapes: dict[object, int] = {}  # shared by drones that look the same

    def add_drone(self, drone: DronePicture, scale: float) -> int:
        """Add a drone, drawn `scale` times its size; returns its body."""
        if self._shape is Shape.BOX:
            box = self._box_shape(drone.size_m(scale), drone.colour)
            return self._add(box, (), drone.centre(scale))
        frame = self._part_shape(frame_file(drone.is_flying), FRAME, scale)
        lamp = self._part_shape(lamp_file(drone.role), drone.colour, scale)
        return self._add(frame, (lamp,), drone.underside(scale))

    def move_drone(self, body: int, drone: DronePicture, scale: float) -> None:
        place = drone.centre(scale) if self._shape is Shape.BOX else drone.underside(scale)
        pybullet.resetBasePositionAndOrientation(body, place, UPRIGHT, physicsClientId=self._client)

    def colour_drone(self, body: int, drone: DronePicture) -> None:
        pybullet.changeVisualShape(
            body,
            BASE if self._shape is Shape.BOX else 0,
            rgbaColor=(*rgb(drone.colour), 1.0),
            physicsClientId=self._client,
        )

    def add_obstacle(self, box: ObstacleStatus) -> int:
        """Add an obstacle; returns its body."""
        shape = self._box_shape(box.size, LIGHT.obstacle, OBSTACLE_OPACITY)
        turned = pybullet.getQuaternionFromEuler((0.0, 0.0, box.yaw))
        return self._add(shape, (), box.center, turned)

    def _add(
        self,
        shape: int,
        links: Sequence[int],
        place: Sequence[float],
        orientation: Sequence[float] = UPRIGHT,
    ) -> int:
        count = len(links)
        return int(
            pybullet.createMultiBody(
                0.0,
                -1,
                shape,
                list(place),
                list(orientation),
                linkMasses=[0.0] * count,
                linkCollisionShapeIndices=[-1] * count,
                linkVisualShapeIndices=list(links),
                linkPositions=[(0.0, 0.0, 0.0)] * count,
                linkOrientations=[UPRIGHT] * count,
                linkInertialFramePositions=[(0.0, 0.0, 0.0)] * count,
                linkInertialFrameOrientations=[UPRIGHT] * count,
                linkParentIndices=[0] * count,
                linkJointTypes=[pybullet.JOINT_FIXED] * count,
                linkJointAxis=[(0.0, 0.0, 1.0)] * count,
                physicsClientId=self._client,
            )
        )

    def _box_shape(self, size: Sequence[float], colour: Colour, opacity: float = 1.0) -> int:
        return int(
            pybullet.createVisualShape(
                pybullet.GEOM_BOX,
                halfExtents=[edge_m / 2 for edge_m in size],
                rgbaColor=(*rgb(colour), opacity),
                specularColor=(0, 0, 0),
                physicsClientId=self._client,
            )
        )

    def _part_shape(self, file: str, colour: Colour, scale: float) -> int:
        key = (file, colour, scale)
        if key not in self._shapes:
            self._shapes[key] = int(
                pybullet.createVisualShape(
                    pybullet.GEOM_MESH,
                    fileName=str(MESHES / file),
                    meshScale=[scale] * 3,
                    rgbaColor=(*rgb(colour), 1.0),
                    specularColor=(0, 0, 0),
                    physicsClientId=self._client,
                )
            )
        return self._shapes[key]


def paste_bodies(image: Image.Image, camera: Camera, scene: Scene, scale: float) -> None:
    """Draw a scene's drones over the image, `scale` times their size.

    Obstacles shade what is behind them.
    """
    client = pybullet.connect(pybullet.DIRECT)
    try:
        bodies = Bodies(client, scene.shape)
        for drone in scene.drones:
            bodies.add_drone(drone, scale)
        colours, seen = _shoot(client, camera)
        image.paste(colours, (0, 0), _mask(seen != NOTHING, 1.0))
        if scene.obstacles:
            added = [bodies.add_obstacle(box) for box in scene.obstacles]
            colours, seen = _shoot(client, camera)
            image.paste(colours, (0, 0), _mask(np.isin(seen, added), OBSTACLE_OPACITY))
    finally:
        pybullet.disconnect(physicsClientId=client)


def _shoot(client: int, camera: Camera) -> tuple[Image.Image, np.ndarray]:
    """The image that this camera takes, and (height, width) the body number of each pixel."""
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
