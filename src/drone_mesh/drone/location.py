"""Location: a position of a drone."""

from __future__ import annotations

import math
import struct
from typing import NamedTuple, Sequence

from drone_mesh.drone.flight_path import Vector

_ON_THE_WIRE = struct.Struct("<ff")


class Location(NamedTuple):
    """A position in the world frame, in metres; z is up (docs/protocol.md, "Terms")."""

    latitude: float  # y
    longitude: float  # x
    height: float  # z of the drone's underside

    def distance_m(self, other: Location) -> float:
        """Straight 3D distance to `other`."""
        return math.dist(self, other)

    def towards(self, end: Location, distance_m: float) -> Location:
        """The point `distance_m` away on the straight line to `end`, at most `end` itself."""
        whole_m = self.distance_m(end)
        share = min(1.0, distance_m / whole_m) if whole_m else 1.0
        return Location(*(a + (b - a) * share for a, b in zip(self, end)))

    @classmethod
    def from_vector(cls, vector: Sequence[float]) -> Location:
        """The position at x, y, z."""
        x, y, z = vector
        return cls(latitude=y, longitude=x, height=z)

    def to_vector(self) -> Vector:
        """The position as x, y, z."""
        return self.longitude, self.latitude, self.height

    def in_words(self) -> str:
        """The position as text: x, y, z."""
        return f"x {self.longitude:.2f} m, y {self.latitude:.2f} m, z {self.height:.0f} m"

    def as_ordered(self) -> Location:
        """The place as an order carries it: float32, whole metres of height. To compare orders."""
        latitude, longitude = _ON_THE_WIRE.unpack(_ON_THE_WIRE.pack(self.latitude, self.longitude))
        return Location(latitude, longitude, float(round(self.height)))


def metres_between(one: Location, other: Location) -> float:
    """Straight 3D distance, for the most frequent questions: compiled, it is a plain call."""
    latitude, longitude, height = one
    other_latitude, other_longitude, other_height = other
    north, east, up = latitude - other_latitude, longitude - other_longitude, height - other_height
    return math.sqrt(north * north + east * east + up * up)
