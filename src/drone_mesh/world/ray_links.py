"""RayLinks: which positions have a radio link past the obstacles, by rays in pybullet."""

from __future__ import annotations

import math
from typing import Sequence

import numpy as np
import pybullet

from drone_mesh.air.obstacles import Obstacles
from drone_mesh.drone.flight_path import Vector
from drone_mesh.world.bullet_world import add_static_box, connect

MISSED = -1  # pybullet's body number for a ray that hits nothing


class RayLinks:
    """The boxes of `obstacles` in a separate pybullet world, and rays between positions.

    Finds the same links as Obstacles.margin_db. Each pair is cast in both directions, because one
    ray enters a box where the other leaves it. A position inside a box is recognised only by the
    missing surface; two positions in one box have a link, but no drone can be there. Not
    thread-safe.
    """

    def __init__(self, obstacles: Obstacles, range_m: float) -> None:
        self._obstacles = obstacles
        self._range_m = range_m
        self._client = connect()
        self._cut_db = {add_static_box(self._client, box): box.cut_db for box in obstacles.boxes}

    def close(self) -> None:
        """Release the pybullet world. A second call changes nothing."""
        if self._client >= 0:
            pybullet.disconnect(physicsClientId=self._client)
            self._client = -1

    def sees(self, here: Vector, others: np.ndarray) -> np.ndarray:
        """(n,) bool: which of these (n, 3) positions, all within range, have a link to `here`."""
        distances_m = np.maximum(np.linalg.norm(others - np.array(here), axis=1), 1e-3)
        margins_db = 10 * self._obstacles.exponent * np.log10(self._range_m / distances_m)
        linked: np.ndarray = margins_db > self._losses_db(here, others, distances_m)
        return linked

    def _losses_db(self, here: Vector, others: np.ndarray, distances_m: np.ndarray) -> list[float]:
        count = len(others)
        starts, ends = [here] * count, others.tolist()
        entered = self._hits(starts, ends)
        left = self._hits(ends, starts)
        return [self._loss_db(entered[i], left[i], float(distances_m[i])) for i in range(count)]

    def _loss_db(
        self, entered: dict[int, float], left: dict[int, float], distance_m: float
    ) -> float:
        """The attenuation. `entered`, `left`: where the ray enters bodies, cast from either end."""
        crossed = sorted({*entered, *left})
        if self._obstacles.blocks:
            return math.inf if crossed else 0.0
        loss_db = 0.0
        for body in crossed:
            cuts = (body in entered) + (body in left)
            inside = 1.0 - (entered.get(body, 0.0) + left.get(body, 0.0))
            loss_db += cuts * self._cut_db[body] + inside * distance_m * self._obstacles.metre_db
        return loss_db

    def _hits(
        self, starts: Sequence[Sequence[float]], ends: Sequence[Sequence[float]]
    ) -> list[dict[int, float]]:
        """For each ray, the bodies that it enters, and the fraction of the ray at which it does."""
        found: list[dict[int, float]] = [{} for _ in starts]
        for number in range(len(self._cut_db)):
            hits = pybullet.rayTestBatch(
                starts, ends, reportHitNumber=number, physicsClientId=self._client
            )
            bodies = [hit[0] for hit in hits]
            for ray, hit in enumerate(hits):
                if hit[0] != MISSED:
                    found[ray].setdefault(hit[0], hit[2])
            if self._obstacles.blocks or all(body == MISSED for body in bodies):
                break
        return found
