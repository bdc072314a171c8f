"""Off-screen pictures of a world.

pybullet's software renderer draws drones and obstacles; Pillow draws lines, dashes and text.
"""

from __future__ import annotations

from pathlib import Path
from typing import Iterator, Sequence, Tuple

from PIL import Image

from drone_mesh.drone.roles import Role
from drone_mesh.state.condition import Condition
from drone_mesh.state.links import LinkUse
from drone_mesh.view.bodies import paste_bodies
from drone_mesh.view.camera import Camera, Margins, frame
from drone_mesh.view.grid import draw_ground
from drone_mesh.view.palette import GROUND, LIGHT, Colour
from drone_mesh.view.scene import (
    DRONE_WIDTH_M,
    DronePicture,
    Scene,
    crowding_m,
    drawing_scale,
)
from drone_mesh.view.sketch import OVERSAMPLING, Sketch

DEFAULT_SIZE = (1280, 800)  # pixels
LEGEND_WIDTH = 168  # pixels
NARROWEST_WITH_LEGEND = 500  # pixels; narrower pictures have no legend
DRONE_PIXELS = 36  # approximate width of a drone
SMALLEST_ID, LARGEST_ID = 9.0, 15.0  # pixels: height of the text
NODE_HEIGHT, LINK_HEIGHT, PATH_HEIGHT = 12.0, 3.0, 2.0  # pixels, of the swatch in the legend
MARGINS = Margins(left=64, top=56, right=24, bottom=56)  # pixels


_LegendRow = Tuple[str, Colour, float]  # meaning and colour; height of the swatch, pixels


def render(scene: Scene, path: str | Path, size: tuple[int, int] = DEFAULT_SIZE) -> None:
    """Write a PNG of `size` (width, height) pixels that shows all drones with their ids.

    Drones are enlarged where there is room. Raises OSError if `path` cannot be written.
    """
    canvas_size = (size[0] * OVERSAMPLING, size[1] * OVERSAMPLING)
    margins = Margins(*(side * OVERSAMPLING for side in margins_of(size)))
    camera = frame(Camera(canvas_size), scene.points(), margins)
    wanted = DRONE_PIXELS * OVERSAMPLING / camera.pixels_per_metre() / DRONE_WIDTH_M
    scale = drawing_scale(scene.drones, wanted)

    image = Image.new("RGB", canvas_size, GROUND)
    sketch = Sketch(image, camera)
    draw_ground(sketch, scene, scale)
    _draw_links(sketch, scene, scale)
    _draw_paths(sketch, scene.drones, scale)
    paste_bodies(image, camera, scene, scale)
    _draw_ids(sketch, scene.drones, scale)
    if _has_legend(size):
        _draw_legend(sketch, scene)
    sketch.words((16, 12), scene.title, 20, LIGHT.ink, anchor="la")
    image.resize(size, Image.Resampling.LANCZOS).save(path, format="PNG")


def margins_of(size: tuple[int, int]) -> Margins:
    """The space to keep free of drones in a picture of this size, for numbers and legend."""
    return MARGINS._replace(right=MARGINS.right + LEGEND_WIDTH) if _has_legend(size) else MARGINS


def _has_legend(size: tuple[int, int]) -> bool:
    return size[0] >= NARROWEST_WITH_LEGEND


def _draw_links(sketch: Sketch, scene: Scene, scale: float) -> None:
    centres = {drone.node_id: drone.centre(scale) for drone in scene.drones}
    widths = {LinkUse.KNOWN: 1.0, LinkUse.LOST: 2.0, LinkUse.ROUTE: 3.0}
    for use, width in widths.items():
        dash = 6 if use is LinkUse.LOST else 0
        for link in scene.links:
            if link.use is use and link.start in centres and link.end in centres:
                ends = [centres[link.start], centres[link.end]]
                sketch.line(ends, LIGHT.of_link(use), width, dash)


def _draw_paths(sketch: Sketch, drones: Sequence[DronePicture], scale: float) -> None:
    for drone in drones:
        if drone.path:
            sketch.line([drone.centre(scale), *drone.path], LIGHT.path, 2, dash=8)
            sketch.ring(drone.path[-1], 7, LIGHT.path)


def _draw_ids(sketch: Sketch, drones: Sequence[DronePicture], scale: float) -> None:
    between = crowding_m(drones) * sketch.camera.pixels_per_metre() / OVERSAMPLING
    height = max(SMALLEST_ID, min(LARGEST_ID, between / 3))
    for drone in drones:
        x, y, z = drone.centre(scale)
        _, depth_m, height_m = drone.size_m(scale)
        text = str(drone.node_id)
        if drone.position[2] >= 0.5:
            text += f" ({drone.position[2]:.0f} m up)"
        sketch.label((x, y + depth_m / 2, z + height_m / 2), text, height, LIGHT.ink, "md")


def _draw_legend(sketch: Sketch, scene: Scene) -> None:
    """In the upper right corner."""
    left = sketch.size[0] - LEGEND_WIDTH
    for i, (text, colour, height) in enumerate(_legend_of(scene)):
        y = 24.0 + 22 * i
        sketch.swatch((left, y), colour, height)
        sketch.words((left + 24, y), text, 14, LIGHT.ink, "lm")


def _legend_of(scene: Scene) -> Iterator[_LegendRow]:
    """Connected gateways and routers, other conditions, obstacles, flight paths and links."""
    for role in (Role.GATEWAY, Role.ROUTER):
        connected = sum(
            drone.role is role and drone.condition is Condition.CONNECTED for drone in scene.drones
        )
        if connected:
            colour = LIGHT.of_node(role, Condition.CONNECTED)
            yield f"{role.word} ({connected})", colour, NODE_HEIGHT
    for condition in Condition:
        count = sum(drone.condition is condition for drone in scene.drones)
        if count and condition is not Condition.CONNECTED:
            yield f"{condition.value} ({count})", LIGHT.of_node(Role.ROUTER, condition), NODE_HEIGHT
    if scene.obstacles:
        yield f"obstacle ({len(scene.obstacles)})", LIGHT.obstacle, NODE_HEIGHT
    if any(drone.path for drone in scene.drones):
        yield "flight path", LIGHT.path, PATH_HEIGHT
    for use in LinkUse:
        if any(link.use is use for link in scene.links):
            yield use.value, LIGHT.of_link(use), LINK_HEIGHT
