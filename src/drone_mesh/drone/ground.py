"""GroundEngine: the drone of a node that stands on the ground."""

from __future__ import annotations

from drone_mesh.drone.interfaces import IDroneEngine
from drone_mesh.drone.location import Location
from drone_mesh.errors import GoalRefused, LocationUnknown


class GroundEngine(IDroneEngine):
    """Stays where it is and refuses every goal. Any thread may call it."""

    def __init__(self, node_id: int, location: Location | None, frame_digest: int = 0) -> None:
        """`location` None: the node's position is unknown."""
        self._frame_digest = frame_digest
        self._node_id = node_id
        self._location = location

    def set_goal(self, latitude: float, longitude: float, height: float) -> None:
        """Raises GoalRefused: the node does not fly."""
        raise GoalRefused(f"drone {self._node_id} cannot fly: {self.why_not_fly()}")

    def get_location(self) -> Location:
        """The given position. Raises LocationUnknown if there is none."""
        if self._location is None:
            raise LocationUnknown("no position was given; use --latitude and --longitude")
        return self._location

    def frame_digest(self) -> int:
        """The digest of --origin."""
        return self._frame_digest

    def why_not_fly(self) -> str:
        """Always: the node never flies."""
        return "it stands on the ground"
