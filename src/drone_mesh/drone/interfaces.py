"""IDroneEngine: the mesh's view of a drone (docs/protocol.md, "Interfaces")."""

from __future__ import annotations

import abc
import math
from typing import NamedTuple


class Location(NamedTuple):
    """A place in the world frame, in metres; z is up (docs/protocol.md, "Terms")."""

    latitude: float  # y
    longitude: float  # x
    height: float  # z of the drone's underside

    def distance_m(self, other: Location) -> float:
        """Straight 3D distance to `other`."""
        return math.sqrt(
            (self.latitude - other.latitude) ** 2
            + (self.longitude - other.longitude) ** 2
            + (self.height - other.height) ** 2
        )


class IDroneEngine(abc.ABC):
    """Where the drone is and where it goes. Both functions may be called at any time."""

    @abc.abstractmethod
    def set_goal(self, latitude: float, longitude: float, height: float) -> None:
        """Fly to this place (metres, world frame). Returns at once; replaces the old goal."""

    @abc.abstractmethod
    def get_location(self) -> Location:
        """Where the drone is now. Raises LocationUnknown when that cannot be found out."""
