"""Off-screen pictures of a world.

pybullet's software renderer draws drones and obstacles; Pillow draws lines, dashes and text, and
the ground: a grid with numbers, and the shadows of the drones.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Iterable, Iterator, Sequence, Tuple

from PIL import Image, ImageDraw, ImageFont

from drone_mesh.drone.flight_path import Vector
from drone_mesh.drone.roles import Role
from drone_mesh.state.condition import Condition
from drone_mesh.state.links import LinkUse
from drone_mesh.view.bodies import paste_bodies
from drone_mesh.view.camera import Camera, Margins, frame
from drone_mesh.view.palette import AXIS, GRID, GROUND, LIGHT, SHADOW, Colour
from drone_mesh.view.scene import (
    DRONE_WIDTH_M,
    DronePicture,
    Scene,
    Shape,
    crowding_m,
    drawing_scale,
)

OVERSAMPLING = 2  # how much larger the image is drawn than the picture, for smooth edges
EDGE = 20  # pixels: text closer to the left or right edge is left out
LEGEND_WIDTH = 168  # pixels
NARROWEST_WITH_LEGEND = 500  # pixels; narrower pictures have no legend
DRONE_PIXELS = 36  # approximate width of a drone
SMALLEST_ID, LARGEST_ID = 9.0, 15.0  # pixels: height of the text
NODE_HEIGHT, LINK_HEIGHT, PATH_HEIGHT = 12.0, 3.0, 2.0  # pixels, of the swatch in the legend
SHADOW_SHARE = 0.42  # radius of a round shadow, as a share of the width
SHADOW_CORNERS = 24  # of the polygon that is drawn for it
GRID_LINES = 12  # approximate number of lines across the picture
MARGINS = Margins(left=64, top=56, right=24, bottom=56)  # pixels
_LegendRow = Tuple[str, Colour, float]  # meaning and colour; height of the swatch, pixels


class Sketch:
    """Draws on an image, in pixels of the finished picture or in metres of the world."""

    def __init__(self, image: Image.Image, camera: Camera) -> None:
        self.camera = camera
        self.size = (image.width / OVERSAMPLING, image.height / OVERSAMPLING)
        self._draw = ImageDraw.Draw(image)

    def line(
        self, points: Sequence[Vector], colour: Colour, width: float, dash: float = 0.0
    ) -> None:
        """A line through these points; `width` and `dash`, the length of a dash, in pixels."""
        pixels = [tuple(pixel) for pixel in self.camera.project(points)]
        for start, end in zip(pixels, pixels[1:]):
            for piece in _dashes(start, end, dash * OVERSAMPLING):
                self._draw.line(piece, colour, round(width * OVERSAMPLING))

    def area(self, points: Sequence[Vector], colour: Colour) -> None:
        self._draw.polygon([tuple(pixel) for pixel in self.camera.project(points)], colour)

    def ring(self, point: Vector, radius: float, colour: Colour) -> None:
        """A circle around a point, `radius` in pixels."""
        (x, y), r = self.camera.project([point])[0], radius * OVERSAMPLING
        self._draw.ellipse((x - r, y - r, x + r, y + r), None, colour, 2 * OVERSAMPLING)

    def label(self, point: Vector, text: str, height: float, colour: Colour, anchor: str) -> None:
        """Text at this point of the world, unless the picture's edge would cut it off."""
        x, y = self.camera.project([point])[0] / OVERSAMPLING
        if EDGE <= x <= self.size[0] - EDGE and 0 <= y <= self.size[1]:
            self.words((x, y), text, height, colour, anchor)

    def words(
        self, pixel: tuple[float, float], text: str, height: float, colour: Colour, anchor: str
    ) -> None:
        """Text with a light rim, legible on any background."""
        x, y = pixel
        self._draw.text(
            (x * OVERSAMPLING, y * OVERSAMPLING),
            text,
            colour,
            ImageFont.load_default(height * OVERSAMPLING),
            anchor,
            stroke_width=2 * OVERSAMPLING,
            stroke_fill=LIGHT.card,
        )

    def swatch(self, pixel: tuple[float, float], colour: Colour, height: float) -> None:
        """A bar in a legend, 16 pixels wide, vertically centred on `pixel`."""
        x, y = (value * OVERSAMPLING for value in pixel)
        half = height / 2 * OVERSAMPLING
        self._draw.rectangle((x, y - half, x + 16 * OVERSAMPLING, y + half), colour)


def _dashes(
    start: tuple[float, ...], end: tuple[float, ...], dash: float
) -> Iterable[tuple[float, float, float, float]]:
    """The dashes of a line, with gaps of the same length; the whole line if `dash` is 0."""
    length = math.dist(start, end)
    count = max(1, round(length / (2 * dash))) if dash else 1
    drawn = 0.5 if dash else 1.0
    for i in range(count):
        first, last = i / count, (i + drawn) / count
        yield (
            start[0] + (end[0] - start[0]) * first,
            start[1] + (end[1] - start[1]) * first,
            start[0] + (end[0] - start[0]) * last,
            start[1] + (end[1] - start[1]) * last,
        )


def render(scene: Scene, path: str | Path, size: tuple[int, int]) -> None:
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
    _draw_ground(sketch, scene, scale)
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


def _draw_ground(sketch: Sketch, scene: Scene, scale: float) -> None:
    """Grid lines, axes, their numbers, and each drone's shadow with a line up to the drone."""
    width, height = sketch.camera.size
    corners = [(0.0, 0.0), (width, 0.0), (0.0, height), (width, height)]
    seen = [point for point in map(sketch.camera.on_ground, corners) if point is not None]
    west, south = (min(point[axis] for point in seen) for axis in (0, 1))
    east, north = (max(point[axis] for point in seen) for axis in (0, 1))
    step_m = _round_step((east - west) / GRID_LINES)
    for x in _multiples(west, east, step_m):
        sketch.line([(x, south, 0.0), (x, north, 0.0)], AXIS if x == 0 else GRID, 1)
    for y in _multiples(south, north, step_m):
        sketch.line([(west, y, 0.0), (east, y, 0.0)], AXIS if y == 0 else GRID, 1)
    for drone in scene.drones:
        x, y, _ = drone.centre(scale)
        outline = _shadow(drone.size_m(scale), scene.shape)
        sketch.area([(x + east_m, y + north_m, 0.0) for east_m, north_m in outline], SHADOW)
        sketch.line([(x, y, 0.0), drone.centre(scale)], SHADOW, 1.5)
    _number_grid(sketch, step_m, (west, south, east, north))


def _shadow(size: Vector, shape: Shape) -> list[tuple[float, float]]:
    if shape is Shape.QUADROCOPTER:
        radius_m = SHADOW_SHARE * max(size)
        angles = [2 * math.pi * i / SHADOW_CORNERS for i in range(SHADOW_CORNERS)]
        return [(radius_m * math.cos(angle), radius_m * math.sin(angle)) for angle in angles]
    half_x, half_y = size[0] / 2, size[1] / 2
    return [(-half_x, -half_y), (half_x, -half_y), (half_x, half_y), (-half_x, half_y)]


def _number_grid(sketch: Sketch, step_m: float, ground: tuple[float, float, float, float]) -> None:
    """Write x (longitude) along the lower edge and y (latitude) along the left one."""
    west, south, east, north = ground
    width, height = sketch.size
    bottom = sketch.camera.on_ground((0.0, sketch.camera.size[1] - 14.0 * OVERSAMPLING))
    for x in _multiples(west, east, step_m):
        if bottom is not None:
            sketch.label((x, bottom[1], 0.0), f"{x:g} m", 11, LIGHT.muted, "mm")
    for y in _multiples(south, north, step_m):
        (_, row), *_rest = sketch.camera.project([(0.0, y, 0.0)]) / OVERSAMPLING
        if 50 < row < height - 30:
            sketch.words((8, row), f"{y:g} m", 11, LIGHT.muted, "lm")


def _round_step(step_m: float) -> float:
    """The smallest of 1, 2 and 5 times a power of ten that is not below this."""
    decade = 10.0 ** math.floor(math.log10(step_m))
    return next(factor * decade for factor in (1, 2, 5, 10) if factor * decade >= step_m)


def _multiples(low: float, high: float, step: float) -> list[float]:
    return [n * step for n in range(math.ceil(low / step), math.floor(high / step) + 1)]
