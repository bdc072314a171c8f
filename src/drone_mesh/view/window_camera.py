"""The camera of the world's window: it follows the fleet until the user moves it."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Sequence

import pybullet

from drone_mesh.drone.flight_path import Vector
from drone_mesh.view.camera import Camera, Margins, frame

MARGINS = Margins(left=90, top=130, right=90, bottom=60)  # pixels
STEEPEST_DEG, FLATTEST_DEG = -89.0, -5.0
FROM_ABOVE_DEG, SLANTED_DEG = STEEPEST_DEG, -60.0


class WindowCamera:
    """The camera of one pybullet window. Belongs to the window's thread."""

    def __init__(self, client: int, size: tuple[int, int]) -> None:
        self._client = client
        self._follows = True
        self.now = Camera(size, pitch_deg=SLANTED_DEG)

    def keep_in_view(self, points: Sequence[Vector]) -> None:
        """Show all these points unless the user has moved the camera."""
        if self._follows:
            self._aim(frame(self.now, points, MARGINS))

    def take_over(self) -> bool:
        """Adopt the window's size and the view set with the mouse; True if anything changed."""
        seen = pybullet.getDebugVisualizerCamera(physicsClientId=self._client)
        (width, height), projection = seen[:2], seen[3]
        yaw_deg, pitch_deg, distance_m, target = seen[8:12]
        if not (width and height and projection[5]):
            return False
        field_of_view_deg = math.degrees(2 * math.atan(1 / projection[5]))
        camera = Camera((width, height), target, distance_m, yaw_deg, pitch_deg, field_of_view_deg)
        moved = not _is_same_view(camera, self.now)
        resized = (camera.size, camera.field_of_view_deg) != (
            self.now.size,
            self.now.field_of_view_deg,
        )
        if moved:
            self._follows = False
        if moved or resized:
            self.now = camera
        return moved or resized

    def follow(self) -> None:
        """Follow the fleet again."""
        self._follows = True

    def look_from_above(self) -> None:
        """Look straight down, or slanted again if it already does; follow the fleet."""
        steep = self.now.pitch_deg <= FROM_ABOVE_DEG
        self._aim(replace(self.now, pitch_deg=SLANTED_DEG if steep else FROM_ABOVE_DEG))
        self._follows = True

    def turn(self, yaw_deg: float, pitch_deg: float) -> None:
        """Turn around the fleet, and tilt within limits."""
        pitch = max(STEEPEST_DEG, min(FLATTEST_DEG, self.now.pitch_deg + pitch_deg))
        self._aim(replace(self.now, yaw_deg=self.now.yaw_deg + yaw_deg, pitch_deg=pitch))

    def zoom(self, factor: float) -> None:
        """Move to `factor` times the distance and stop following the fleet's size."""
        self._follows = False
        self._aim(replace(self.now, distance_m=self.now.distance_m * factor))

    def _aim(self, camera: Camera) -> None:
        if camera != self.now:
            self.now = camera
            pybullet.resetDebugVisualizerCamera(
                camera.distance_m,
                camera.yaw_deg,
                camera.pitch_deg,
                camera.target,
                physicsClientId=self._client,
            )


def _is_same_view(camera: Camera, other: Camera) -> bool:
    """Whether two cameras agree within pybullet's single precision."""
    return all(
        math.isclose(a, b, rel_tol=1e-3, abs_tol=1e-2)
        for a, b in zip(
            (*camera.target, camera.distance_m, camera.yaw_deg, camera.pitch_deg),
            (*other.target, other.distance_m, other.yaw_deg, other.pitch_deg),
        )
    )
