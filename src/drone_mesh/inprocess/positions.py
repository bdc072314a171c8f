"""What a drone knows of its own position: with noise, with outliers, or nothing."""

from __future__ import annotations

import math
import random
from dataclasses import dataclass

from drone_mesh.drone.interfaces import IDroneEngine
from drone_mesh.drone.location import Location
from drone_mesh.errors import LocationUnknown
from drone_mesh.inprocess.clock import Clock
from drone_mesh.inprocess.drone import InProcessDrone

CORRELATED_S = 10.0  # the error of a receiver drifts; after this time it is another one


@dataclass(frozen=True)
class PositionErrors:
    """The errors of the positions that the mesh software gets; flights and links are exact."""

    sigma_m: float = 0.0  # standard deviation along x and along y
    outliers: float = 0.0  # share of positions that are wrong by `outlier_m` in some direction
    outlier_m: float = 0.0
    known: bool = True  # False: no drone knows its position

    @property
    def none(self) -> bool:
        """Whether positions are exact."""
        return self.known and not self.sigma_m and not self.outliers


class PositionReceiver(IDroneEngine):
    """A drone whose position the mesh learns from a receiver with errors."""

    def __init__(
        self, drone: InProcessDrone, clock: Clock, errors: PositionErrors, rng: random.Random
    ) -> None:
        self._drone, self._clock, self._errors, self._rng = drone, clock, errors, rng
        self._error_m = (self._drawn(), self._drawn())
        self._drawn_s = 0.0

    def set_goal(self, latitude: float, longitude: float, height: float) -> None:
        self._drone.set_goal(latitude, longitude, height)

    def why_not_fly(self) -> str:
        return self._drone.why_not_fly()

    def get_location(self) -> Location:
        if not self._errors.known:
            raise LocationUnknown("no position receiver")
        place = self._drone.get_location()
        x_m, y_m = self._drifted()
        if self._rng.random() < self._errors.outliers:
            angle = self._rng.uniform(-math.pi, math.pi)
            x_m += self._errors.outlier_m * math.cos(angle)
            y_m += self._errors.outlier_m * math.sin(angle)
        return Location(place.latitude + y_m, place.longitude + x_m, place.height)

    def _drifted(self) -> tuple[float, float]:
        """The error now: normally distributed, and correlated over CORRELATED_S."""
        now_s = self._clock.now_s
        kept = math.exp(-(now_s - self._drawn_s) / CORRELATED_S)
        fresh = math.sqrt(1.0 - kept**2)
        x_m, y_m = (kept * before + fresh * self._drawn() for before in self._error_m)
        self._error_m, self._drawn_s = (x_m, y_m), now_s
        return self._error_m

    def _drawn(self) -> float:
        return self._rng.gauss(0.0, self._errors.sigma_m)
