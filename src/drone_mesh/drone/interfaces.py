"""IDroneEngine: the mesh's view of a drone (docs/protocol.md, "Interfaces")."""

from __future__ import annotations

import abc
import math
from typing import NamedTuple, Sequence

from drone_mesh.drone.flight_path import Vector


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

    @classmethod
    def from_vector(cls, vector: Sequence[float]) -> Location:
        """The place at x, y, z."""
        x, y, z = vector
        return cls(latitude=y, longitude=x, height=z)

    def to_vector(self) -> Vector:
        """x, y, z of the place."""
        return self.longitude, self.latitude, self.height

    def in_words(self) -> str:
        """The place for people, as x, y, z."""
        return f"x {self.longitude:.2f} m, y {self.latitude:.2f} m, z {self.height:.0f} m"


class IDroneEngine(abc.ABC):
    """Where the drone is and where it goes. Any thread may call every function at any time.

    An engine of your own needs `set_goal` and `get_location`; the others have defaults that suit a
    drone that can always fly.
    """

    @abc.abstractmethod
    def set_goal(self, latitude: float, longitude: float, height: float) -> None:
        """Fly to this place (metres, world frame). Returns at once; replaces the old goal."""

    @abc.abstractmethod
    def get_location(self) -> Location:
        """Where the drone is now. Raises LocationUnknown when that cannot be found out."""

    def why_not_fly(self) -> str:
        """Why the drone would not fly to a goal now; empty while it would."""
        return ""

    def can_fly(self) -> bool:
        """Whether the drone would fly to a goal now. `why_not_fly` is the one to override."""
        return not self.why_not_fly()

    def is_flying(self) -> bool | None:
        """Whether a flight to a goal is under way; None: judge by the places it reports."""
        return None

    def battery_percent(self) -> float | None:
        """The charge of its battery, 0..100; None: not known."""
        return None

    def step_back_to(self, latitude: float, longitude: float, height: float) -> None:
        """Fly to the place of another node, to repair the mesh; else as `set_goal`.

        An engine overrides this when it ends a repair in another way than an ordered flight, for
        example hovering instead of landing.
        """
        self.set_goal(latitude, longitude, height)

    def frame_digest(self) -> int:
        """A number 1..65535 for the origin that its places are counted from; 0: it has none.

        Nodes take places only from nodes with the same number.
        """
        return 0

    def close(self) -> None:  # noqa: B027 - most engines hold nothing
        """Release what the engine holds. Called once, after the last other call."""
