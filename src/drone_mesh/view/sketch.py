"""Draws lines and text on a picture of the world, in pixels or in metres of the world."""

from __future__ import annotations

import math
from typing import Iterable, Sequence

from PIL import Image, ImageDraw, ImageFont

from drone_mesh.drone.flight_path import Vector
from drone_mesh.view.camera import Camera
from drone_mesh.world.interfaces import Colour

OVERSAMPLING = 2  # images are that many times larger than the finished picture: smooth edges
EDGE = 20  # pixels: no text has its middle nearer to the left or right edge
RIM: Colour = (1.0, 1.0, 1.0, 1.0)  # around text


def rgb(colour: Colour) -> tuple[int, int, int]:
    """The colour in bytes, without its opacity."""
    red, green, blue, _ = colour
    return (round(red * 255), round(green * 255), round(blue * 255))


class Sketch:
    """Draws on an image in pixels of the finished picture or in metres of the world."""

    def __init__(self, image: Image.Image, camera: Camera) -> None:
        self.camera = camera
        self.size = (image.width / OVERSAMPLING, image.height / OVERSAMPLING)
        self._draw = ImageDraw.Draw(image)

    def line(
        self, points: Sequence[Vector], colour: Colour, width: float, dash: float = 0.0
    ) -> None:
        """A line through these places; `width`, and `dash` of one stroke, in pixels."""
        pixels = [tuple(pixel) for pixel in self.camera.project(points)]
        for start, end in zip(pixels, pixels[1:]):
            for piece in _dashes(start, end, dash * OVERSAMPLING):
                self._draw.line(piece, rgb(colour), round(width * OVERSAMPLING))

    def area(self, points: Sequence[Vector], colour: Colour) -> None:
        self._draw.polygon([tuple(pixel) for pixel in self.camera.project(points)], rgb(colour))

    def ring(self, place: Vector, radius: float, colour: Colour) -> None:
        (x, y), r = self.camera.project([place])[0], radius * OVERSAMPLING
        self._draw.ellipse((x - r, y - r, x + r, y + r), None, rgb(colour), 2 * OVERSAMPLING)

    def label(self, place: Vector, text: str, height: float, colour: Colour, anchor: str) -> None:
        """`words` at this place of the world, unless the picture's edge would cut them off."""
        x, y = self.camera.project([place])[0] / OVERSAMPLING
        if EDGE <= x <= self.size[0] - EDGE and 0 <= y <= self.size[1]:
            self.words((x, y), text, height, colour, anchor)

    def words(
        self, pixel: tuple[float, float], text: str, height: float, colour: Colour, anchor: str
    ) -> None:
        """Text with a light rim, so that it can be read on anything."""
        x, y = pixel
        self._draw.text(
            (x * OVERSAMPLING, y * OVERSAMPLING),
            text,
            rgb(colour),
            ImageFont.load_default(height * OVERSAMPLING),
            anchor,
            stroke_width=2 * OVERSAMPLING,
            stroke_fill=rgb(RIM),
        )

    def swatch(self, pixel: tuple[float, float], colour: Colour, height: float) -> None:
        """A bar in a legend, 16 pixels wide, with its middle at this height."""
        x, y = (value * OVERSAMPLING for value in pixel)
        half = height / 2 * OVERSAMPLING
        self._draw.rectangle((x, y - half, x + 16 * OVERSAMPLING, y + half), rgb(colour))


def _dashes(
    start: tuple[float, ...], end: tuple[float, ...], dash: float
) -> Iterable[tuple[float, float, float, float]]:
    """The strokes of a dashed line, gaps as long as dashes; the whole line without dashes."""
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
