"""A picture of a world, made without a screen.

pybullet's software renderer draws the boxes; Pillow draws what it cannot: lines, dashes and text.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import NamedTuple, Sequence

import numpy as np
import pybullet
from PIL import Image

from drone_mesh.drone.roles import Role
from drone_mesh.view.camera import Camera, Margins, frame
from drone_mesh.view.picture import (
    DRONE_WIDTH_M,
    LINK_COLOURS,
    PATH_COLOUR,
    DroneCondition,
    DronePicture,
    LinkUse,
    Scene,
    crowding_m,
    drawing_scale,
)
from drone_mesh.view.sketch import OVERSAMPLING, Sketch, rgb
from drone_mesh.world.bullet_world import BulletWorld
from drone_mesh.world.interfaces import Colour

DEFAULT_SIZE = (1280, 800)  # pixels

GROUND: Colour = (0.955, 0.960, 0.945, 1.0)
GRID: Colour = (0.84, 0.86, 0.84, 1.0)
AXIS: Colour = (0.66, 0.70, 0.68, 1.0)
SHADOW: Colour = (0.80, 0.82, 0.80, 1.0)
INK: Colour = (0.09, 0.12, 0.16, 1.0)
FAINT_INK: Colour = (0.42, 0.46, 0.50, 1.0)

LEGEND_WIDTH = 168  # pixels
NARROWEST_WITH_LEGEND = 500  # pixels; a picture of less width is all map
DRONE_PIXELS = 24  # about as wide as a drone should be
SMALLEST_ID, LARGEST_ID = 9.0, 15.0  # pixels: height of the text
GRID_LINES = 12  # about as many as should be seen across
MARGINS = Margins(left=64, top=56, right=24, bottom=56)  # pixels
LIGHT_FROM = (-3.0, -6.0, 12.0)


def render(scene: Scene, path: str | Path, size: tuple[int, int] = DEFAULT_SIZE) -> None:
    """Write a PNG of `size` (width, height) pixels that shows all drones with their ids.

    Drones are drawn larger than they are where there is room. Raises OSError when `path` cannot be
    written.
    """
    canvas_size = (size[0] * OVERSAMPLING, size[1] * OVERSAMPLING)
    margins = Margins(*(side * OVERSAMPLING for side in margins_of(size)))
    camera = frame(Camera(canvas_size), scene.points(), margins)
    wanted = DRONE_PIXELS * OVERSAMPLING / camera.pixels_per_metre() / DRONE_WIDTH_M
    scale = drawing_scale(scene.drones, wanted)

    image = Image.new("RGB", canvas_size, rgb(GROUND))
    sketch = Sketch(image, camera)
    _draw_ground(sketch, scene.drones, scale)
    _draw_links(sketch, scene, scale)
    _draw_flights(sketch, scene.drones, scale)
    _paste_boxes(image, camera, scene.drones, scale)
    _draw_ids(sketch, scene.drones, scale)
    if _has_legend(size):
        _draw_legend(sketch, scene)
    sketch.words((16, 12), scene.title, 20, INK, anchor="la")
    image.resize(size, Image.Resampling.LANCZOS).save(path, format="PNG")


def margins_of(size: tuple[int, int]) -> Margins:
    """Where no drone is drawn in a picture of that size: numbers, title and legend stand there."""
    return MARGINS._replace(right=MARGINS.right + LEGEND_WIDTH) if _has_legend(size) else MARGINS


def _has_legend(size: tuple[int, int]) -> bool:
    return size[0] >= NARROWEST_WITH_LEGEND


def _draw_ground(sketch: Sketch, drones: Sequence[DronePicture], scale: float) -> None:
    width, height = sketch.camera.size
    corners = [(0.0, 0.0), (width, 0.0), (0.0, height), (width, height)]
    seen = [place for place in map(sketch.camera.on_ground, corners) if place is not None]
    west, south = (min(place[axis] for place in seen) for axis in (0, 1))
    east, north = (max(place[axis] for place in seen) for axis in (0, 1))
    step_m = _round_step((east - west) / GRID_LINES)
    for x in _multiples(west, east, step_m):
        sketch.line([(x, south, 0.0), (x, north, 0.0)], AXIS if x == 0 else GRID, 1)
    for y in _multiples(south, north, step_m):
        sketch.line([(west, y, 0.0), (east, y, 0.0)], AXIS if y == 0 else GRID, 1)
    for drone in drones:
        x, y, _ = drone.position
        half_x, half_y = (edge_m / 2 for edge_m in drone.size_m(scale)[:2])
        sketch.area(
            [
                (x + east_m, y + north_m, 0.0)
                for east_m, north_m in (
                    (-half_x, -half_y),
                    (half_x, -half_y),
                    (half_x, half_y),
                    (-half_x, half_y),
                )
            ],
            SHADOW,
        )
        sketch.line([(x, y, 0.0), drone.position], SHADOW, 1.5)
    _number_grid(sketch, step_m, (west, south, east, north))


def _number_grid(sketch: Sketch, step_m: float, ground: tuple[float, float, float, float]) -> None:
    """Longitudes along the lower edge, latitudes along the left one."""
    west, south, east, north = ground
    width, height = sketch.size
    bottom = sketch.camera.on_ground((0.0, sketch.camera.size[1] - 14.0 * OVERSAMPLING))
    for x in _multiples(west, east, step_m):
        if bottom is not None:
            sketch.label((x, bottom[1], 0.0), f"{x:g} m", 11, FAINT_INK, "mm")
    for y in _multiples(south, north, step_m):
        (_, row), *_rest = sketch.camera.project([(0.0, y, 0.0)]) / OVERSAMPLING
        if 50 < row < height - 30:
            sketch.words((8, row), f"{y:g} m", 11, FAINT_INK, "lm")


def _draw_links(sketch: Sketch, scene: Scene, scale: float) -> None:
    centres = {drone.node_id: drone.centre(scale) for drone in scene.drones}
    widths = {LinkUse.KNOWN: 1.0, LinkUse.LOST: 2.0, LinkUse.ROUTE: 3.0}
    for use, width in widths.items():
        for link in scene.links:
            if link.use is use and link.start in centres and link.end in centres:
                ends = [centres[link.start], centres[link.end]]
                sketch.line(ends, LINK_COLOURS[use], width, dash=6 if use is LinkUse.LOST else 0)


def _draw_flights(sketch: Sketch, drones: Sequence[DronePicture], scale: float) -> None:
    for drone in drones:
        if drone.path:
            sketch.line([drone.centre(scale), *drone.path], PATH_COLOUR, 2, dash=8)
            sketch.ring(drone.path[-1], 7, PATH_COLOUR)


def _draw_ids(sketch: Sketch, drones: Sequence[DronePicture], scale: float) -> None:
    between = crowding_m(drones) * sketch.camera.pixels_per_metre() / OVERSAMPLING
    height = max(SMALLEST_ID, min(LARGEST_ID, between / 3))
    for drone in drones:
        x, y, z = drone.centre(scale)
        _, depth_m, height_m = drone.size_m(scale)
        text = str(drone.node_id)
        if drone.position[2] >= 0.5:
            text += f" ({drone.position[2]:.0f} m up)"
        sketch.label((x, y + depth_m / 2, z + height_m / 2), text, height, INK, "md")


class _LegendRow(NamedTuple):
    text: str
    colour: Colour
    height: float  # of the swatch, pixels
    amount: int | None  # how many there are; None: not counted


def _draw_legend(sketch: Sketch, scene: Scene) -> None:
    """What the colours that occur mean, in the upper right corner."""
    rows: list[_LegendRow] = []
    for role in (Role.GATEWAY, Role.ROUTER):
        of_role = [drone for drone in scene.drones if drone.role is role]
        connected = [d for d in of_role if d.condition is DroneCondition.CONNECTED]
        if connected:
            rows.append(_LegendRow(role.word, connected[0].colour, 12, len(connected)))
    for condition in DroneCondition:
        others = [d for d in scene.drones if d.condition is condition]
        if others and condition is not DroneCondition.CONNECTED:
            rows.append(_LegendRow(condition.value, others[0].colour, 12, len(others)))
    if any(drone.path for drone in scene.drones):
        rows.append(_LegendRow("flight", PATH_COLOUR, 2, None))
    for use in (LinkUse.ROUTE, LinkUse.KNOWN, LinkUse.LOST):
        if any(link.use is use for link in scene.links):
            rows.append(_LegendRow(use.value, LINK_COLOURS[use], 3, None))
    for i, row in enumerate(rows):
        y = 24.0 + 22 * i
        amount = "" if row.amount is None else f" ({row.amount})"
        sketch.swatch((sketch.size[0] - LEGEND_WIDTH, y), row.colour, row.height)
        sketch.words((sketch.size[0] - LEGEND_WIDTH + 24, y), row.text + amount, 14, INK, "lm")


def _paste_boxes(
    image: Image.Image, camera: Camera, drones: Sequence[DronePicture], scale: float
) -> None:
    """Draw the drones' boxes over what is in the image so far."""
    with BulletWorld() as world:
        for drone in drones:
            world.add_box(drone.size_m(scale), drone.colour, drone.centre(scale))
        width, height, pixels, _, bodies = pybullet.getCameraImage(
            *camera.size,
            camera.view_matrix(),
            camera.projection_matrix(),
            lightDirection=LIGHT_FROM,
            shadow=0,
            renderer=pybullet.ER_TINY_RENDERER,
            physicsClientId=world.client,
        )
        boxes = np.reshape(bodies, (height, width)) > world.ground
    colours = np.reshape(pixels, (height, width, 4))[:, :, :3].astype(np.uint8)
    image.paste(Image.fromarray(colours), (0, 0), Image.fromarray(boxes))


def _round_step(step_m: float) -> float:
    """The smallest of 1, 2 and 5 times a power of ten that is not below this."""
    decade = 10.0 ** math.floor(math.log10(step_m))
    return next(factor * decade for factor in (1, 2, 5, 10) if factor * decade >= step_m)


def _multiples(low: float, high: float, step: float) -> list[float]:
    return [n * step for n in range(math.ceil(low / step), math.floor(high / step) + 1)]
