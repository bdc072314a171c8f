"""The ground of a snapshot: a grid with numbers, and the shadows of the drones."""

from __future__ import annotations

import math

from drone_mesh.drone.flight_path import Vector
from drone_mesh.view.palette import AXIS, GRID, LIGHT, SHADOW
from drone_mesh.view.scene import Scene, Shape
from drone_mesh.view.sketch import OVERSAMPLING, Sketch

SHADOW_SHARE = 0.42  # radius of a round shadow, as a share of the width
SHADOW_CORNERS = 24  # of the polygon that is drawn for it
GRID_LINES = 12  # approximate number of lines across the picture


def draw_ground(sketch: Sketch, scene: Scene, scale: float) -> None:
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
