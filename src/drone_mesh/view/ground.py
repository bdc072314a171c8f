"""The ground in the world's window: tiles with visible edges, for measuring by eye."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

import pybullet
from PIL import Image, ImageDraw

from drone_mesh.view.palette import GROUND, SHADOW

TILE_PIXELS = 256


def lay_ground(client: int) -> None:
    """A plane of tiles, which pybullet draws 2 m wide."""
    plane = pybullet.createCollisionShape(pybullet.GEOM_PLANE, physicsClientId=client)
    ground = pybullet.createMultiBody(0.0, plane, physicsClientId=client)
    tile = Image.new("RGB", (TILE_PIXELS, TILE_PIXELS), GROUND)
    last = TILE_PIXELS - 1
    ImageDraw.Draw(tile).rectangle((0, 0, last, last), None, SHADOW, 3)
    with tempfile.TemporaryDirectory() as folder:  # pybullet reads textures only from files
        path = Path(folder) / "tile.png"
        tile.save(path)
        texture = pybullet.loadTexture(os.fspath(path), physicsClientId=client)
    pybullet.changeVisualShape(
        ground,
        -1,
        rgbaColor=(1, 1, 1, 1),
        specularColor=(0, 0, 0),
        textureUniqueId=texture,
        physicsClientId=client,
    )
