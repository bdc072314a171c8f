"""A pinhole camera that looks down at the world, and how to frame points with it."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import NamedTuple, Sequence

import numpy as np
import pybullet

from drone_mesh.drone.flight_path import Vector

NEAR_M = 0.1
FAR_M = 50_000.0  # valid goals are within +-5000 m
CLOSEST_M = 6.0  # least distance: a single drone is shown with a few metres around it
UP_AXIS_Z = 2  # pybullet's number for "z is up"


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
        """World to camera, 4 x 4 in column-major order, as pybullet expects it."""
        matrix: Sequence[float] = pybullet.computeViewMatrixFromYawPitchRoll(
            self.target, self.distance_m, self.yaw_deg, self.pitch_deg, 0.0, UP_AXIS_Z
        )
        return matrix

    def projection_matrix(self) -> Sequence[float]:
        """Camera to picture, 4 x 4 in column-major order, as pybullet expects it."""
        near_m = max(NEAR_M, self.distance_m / 100)  # near and far share the depth buffer
        matrix: Sequence[float] = pybullet.computeProjectionMatrixFOV(
            self.field_of_view_deg, self.size[0] / self.size[1], near_m, FAR_M
        )
        return matrix

    def project(self, points: Sequence[Vector]) -> np.ndarray:
        """(n, 2) pixels of these points; NaN for what lies behind the camera."""
        view, projection = (
            np.array(matrix).reshape(4, 4).T
            for matrix in (self.view_matrix(), self.projection_matrix())
        )
        homogeneous = np.ones((len(points), 4))
        homogeneous[:, :3] = np.array(points, dtype=float).reshape(-1, 3)
        clip = homogeneous @ (projection @ view).T
        behind = clip[:, 3] <= 0
        clip[behind] = np.nan
        ndc = clip[:, :2] / clip[:, 3:]
        width, height = self.size
        pixels: np.ndarray = (ndc * [1, -1] + 1) / 2 * [width, height]
        return pixels

    def pixels_per_metre(self) -> float:
        """The size of one metre at the target, in pixels."""
        return self.size[1] / 2 / (self.distance_m * self.half_height_slope())

    def axes(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Unit vectors (3,) in the world that point right, up and forward in the picture."""
        view = np.array(self.view_matrix()).reshape(4, 4).T
        return view[0, :3], view[1, :3], -view[2, :3]

    def half_height_slope(self) -> float:
        """How far up the view extends per metre of depth."""
        return math.tan(math.radians(self.field_of_view_deg / 2))

    def on_ground(self, pixel: tuple[float, float]) -> Vector | None:
        """The point on the ground (z = 0) at this pixel; None if the pixel shows the sky."""
        (x, y, z), (far_x, far_y, far_z) = self.before(pixel, 0.0), self.before(pixel, 1.0)
        if far_z >= z:
            return None
        times = z / (z - far_z)
        return (x + (far_x - x) * times, y + (far_y - y) * times, 0.0)

    def before(self, pixel: tuple[float, float], depth_m: float) -> Vector:
        """The point at this pixel, `depth_m` in front of the camera."""
        right, up, forward = self.axes()
        half_height_m = depth_m * self.half_height_slope()
        x, y = (pixel[axis] - self.size[axis] / 2 for axis in (0, 1))
        aside_m = np.array([x, -y]) / (self.size[1] / 2) * half_height_m
        eye = np.array(self.target) - forward * self.distance_m
        return _vector(eye + forward * depth_m + right * aside_m[0] + up * aside_m[1])


class Margins(NamedTuple):
    """The space to leave free at each side of a picture, in pixels."""

    left: float
    top: float
    right: float
    bottom: float


def frame(camera: Camera, points: Sequence[Vector], margins: Margins) -> Camera:
    """`camera`, moved (not turned) as close as possible with all points between the margins.

    Margins larger than half of the picture shrink. Without points the camera does not move.
    """
    if not points:
        return camera
    positions = np.array(points, dtype=float)
    middle = (positions.min(axis=0) + positions.max(axis=0)) / 2
    right, up, forward = camera.axes()
    depths_m = (positions - middle) @ forward
    closest_m = CLOSEST_M - depths_m.min()

    # Take a point r to the right of the middle and f behind it, and an eye e to the right of the
    # middle and d in front of it: the point is visible if -low <= (r - e) / (f + d) <= high.
    size = np.array(camera.size, dtype=float)
    edges = np.array([[margins.left, margins.right], [margins.bottom, margins.top]], float)
    edges *= np.minimum(1.0, size / 2 / np.maximum(edges.sum(axis=1), 1.0))[:, None]
    slopes = (size[:, None] / 2 - edges) / (size[1] / 2) * camera.half_height_slope()
    aside_m = [(positions - middle) @ axis for axis in (right, up)]
    bounds = [
        ((aside - high * depths_m).max(), (aside + low * depths_m).min())
        for aside, (low, high) in zip(aside_m, slopes)
    ]
    needed_m = [
        (above - below) / (low + high) for (above, below), (low, high) in zip(bounds, slopes)
    ]
    distance_m = max(closest_m, *needed_m)
    eye_right, eye_up = (
        ((above - high * distance_m) + (below + low * distance_m)) / 2
        for (above, below), (low, high) in zip(bounds, slopes)
    )
    target = middle + right * eye_right + up * eye_up
    return replace(camera, target=_vector(target), distance_m=float(distance_m))


def _vector(values: np.ndarray) -> Vector:
    return (float(values[0]), float(values[1]), float(values[2]))
