"""A pinhole camera that looks down at the world, and the place from which all can be seen."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple, Sequence

import numpy as np
import pybullet

from drone_mesh.world.flight_path import Vector

NEAR_M = 0.1
FAR_M = 50_000.0  # the goals that are allowed lie within +-5000 m
CLOSEST_M = 6.0  # a single drone is shown with a few metres around it
UP_AXIS_Z = 2  # pybullet's number for "z is up"
FRAMING_ROUNDS = 40  # each shifts and zooms once; the error shrinks by more than half each time


@dataclass(frozen=True)
class Camera:
    """Looks at `target` from `distance_m` away. Pixels count from the upper left corner."""

    size: tuple[int, int]  # width, height in pixels
    target: Vector = (0.0, 0.0, 0.0)
    distance_m: float = 20.0
    yaw_deg: float = 0.0  # 0: x to the right and y into the picture
    pitch_deg: float = -55.0  # -90: straight down
    field_of_view_deg: float = 40.0  # vertical

    def view_matrix(self) -> Sequence[float]:
        """World to camera, 4 x 4, column by column, as pybullet wants it."""
        matrix: Sequence[float] = pybullet.computeViewMatrixFromYawPitchRoll(
            self.target, self.distance_m, self.yaw_deg, self.pitch_deg, 0.0, UP_AXIS_Z
        )
        return matrix

    def projection_matrix(self) -> Sequence[float]:
        """Camera to picture, 4 x 4, column by column, as pybullet wants it."""
        near_m = max(NEAR_M, self.distance_m / 100)  # near and far share the depth's few bits
        matrix: Sequence[float] = pybullet.computeProjectionMatrixFOV(
            self.field_of_view_deg, self.size[0] / self.size[1], near_m, FAR_M
        )
        return matrix

    def project(self, points: Sequence[Vector]) -> np.ndarray:
        """(n, 2) pixels of these points; NaN for what lies behind the camera."""
        clip = self._clip(points)
        behind = clip[:, 3] <= 0
        clip[behind] = np.nan
        ndc = clip[:, :2] / clip[:, 3:]
        width, height = self.size
        pixels: np.ndarray = (ndc * [1, -1] + 1) / 2 * [width, height]
        return pixels

    def pixels_per_metre(self) -> float:
        """How large a metre at the target is."""
        half_height_m = self.distance_m * np.tan(np.radians(self.field_of_view_deg / 2))
        return float(self.size[1] / 2 / half_height_m)

    def on_ground(self, pixel: tuple[float, float]) -> Vector | None:
        """The point of the ground (z = 0) that is seen in this pixel; None: that is sky."""
        inverse = np.linalg.inv(self._matrix())
        x, y = 2 * pixel[0] / self.size[0] - 1, 1 - 2 * pixel[1] / self.size[1]
        near, far = (inverse @ np.array([x, y, depth, 1.0]) for depth in (-1.0, 1.0))
        start, end = near[:3] / near[3], far[:3] / far[3]
        if end[2] >= start[2]:
            return None
        share = start[2] / (start[2] - end[2])
        point = start + share * (end - start)
        return (float(point[0]), float(point[1]), 0.0) if share <= 1 else None

    def _matrix(self) -> np.ndarray:
        """World to clip space, (4, 4)."""
        view, projection = (
            np.array(matrix).reshape(4, 4).T
            for matrix in (self.view_matrix(), self.projection_matrix())
        )
        matrix: np.ndarray = projection @ view
        return matrix

    def _clip(self, points: Sequence[Vector]) -> np.ndarray:
        """(n, 4) clip coordinates."""
        homogeneous = np.ones((len(points), 4))
        homogeneous[:, :3] = np.array(points, dtype=float).reshape(-1, 3)
        clip: np.ndarray = homogeneous @ self._matrix().T
        return clip


class Margins(NamedTuple):
    """What is to stay free at each side of a picture, in pixels."""

    left: float
    top: float
    right: float
    bottom: float


def frame(camera: Camera, points: Sequence[Vector], margins: Margins) -> Camera:
    """`camera`, moved (not turned) until all points are in the picture and fill it.

    Margins that would take more than half of the picture shrink. Without points nothing moves.
    """
    if not points:
        return camera
    size = np.array(camera.size, dtype=float)
    low_margin = np.array([margins.left, margins.top])
    high_margin = np.array([margins.right, margins.bottom])
    shrink = np.minimum(1.0, size / 2 / np.maximum(low_margin + high_margin, 1.0))
    low_edge, high_edge = low_margin * shrink, size - high_margin * shrink

    places = np.array(points, dtype=float)
    middle = (places.min(axis=0) + places.max(axis=0)) / 2
    span_m = float(np.linalg.norm(places.max(axis=0) - places.min(axis=0)))
    camera = replace(camera, target=_vector(middle), distance_m=max(CLOSEST_M, 3 * span_m))
    view = np.array(camera.view_matrix()).reshape(4, 4).T
    right, up = view[0, :3], view[1, :3]
    for _ in range(FRAMING_ROUNDS):
        pixels = camera.project(points)
        low, high = pixels.min(axis=0), pixels.max(axis=0)
        zoom = float(((high - low) / (high_edge - low_edge)).max())
        camera = replace(camera, distance_m=max(CLOSEST_M, camera.distance_m * zoom))
        pixels = camera.project(points)
        low, high = pixels.min(axis=0), pixels.max(axis=0)
        shift_m = ((low + high) - (low_edge + high_edge)) / 2 / camera.pixels_per_metre()
        target = np.array(camera.target) + right * shift_m[0] - up * shift_m[1]
        camera = replace(camera, target=_vector(target))
    return camera


def _vector(values: np.ndarray) -> Vector:
    return (float(values[0]), float(values[1]), float(values[2]))
