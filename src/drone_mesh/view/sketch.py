"""Draws lines and text on a picture of the world, in pixels or in metres of the world."""

from __future__ import annotations

import math
from typing import Iterable, Sequence

from PIL import Image, ImageDraw, ImageFont

from drone_mesh.drone.flight_path import Vector
from drone_mesh.view.camera import Camera
from drone_mesh.view.palette import Colour

OVERSAMPLING = 2  # how much larger the image is drawn than the picture, for smooth edges
EDGE = 20  # pixels: text closer to the left or right edge is left out
RIM: Colour = "#ffffff"  # around text


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
        """A filled polygon."""
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
            stroke_fill=RIM,
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
