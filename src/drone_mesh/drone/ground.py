"""GroundEngine: the drone of a node that stands on the ground."""

from __future__ import annotations

import logging

from drone_mesh.drone.goal import check_goal
from drone_mesh.drone.interfaces import IDroneEngine, Location

_log = logging.getLogger(__name__)


class GroundEngine(IDroneEngine):
    """Stays where it is, and logs the goals that it gets. Any thread may call it."""

    def __init__(self, node_id: int, location: Location) -> None:
        self._node_id = node_id
        self._location = location

    def set_goal(self, latitude: float, longitude: float, height: float) -> None:
        """Log the goal. Raises GoalRefused for a place that no drone may be sent to."""
        check_goal(latitude, longitude, height)
        here = self._location
        _log.info(
            "node %d stands on the ground at latitude %g m, longitude %g m, height %g m and does "
            "not fly to its goal: latitude %g m, longitude %g m, height %g m",
            self._node_id,
            *here,
            latitude,
            longitude,
            height,
        )

    def get_location(self) -> Location:
        """Where it was put. Never raises."""
        return self._location

    def why_not_fly(self) -> str:
        """It never flies."""
        return "it stands on the ground"
