"""GroundedDrones: which drones cannot fly now, as reported by the process that flies them."""

from __future__ import annotations

import rospy

from drone_mesh.msg import GroundedDrones as GroundedDronesMsg
from drone_mesh.ros.graph import names


class GroundedDrones:
    """Subscribes: /Drones/grounded (GroundedDrones). Any thread may ask."""

    def __init__(self) -> None:
        self._reasons: dict[int, str] = {}  # replaced as a whole by rospy's thread
        self._subscriber = rospy.Subscriber(names.GROUNDED_TOPIC, GroundedDronesMsg, self._changed)

    def reason(self, node_id: int) -> str:
        """Why this drone cannot fly now; empty if it can, or if that is unknown."""
        return self._reasons.get(node_id, "")

    def stop(self) -> None:
        """Leave the topic."""
        self._subscriber.unregister()

    def _changed(self, message: GroundedDronesMsg) -> None:
        self._reasons = dict(zip(message.ids, message.reasons))
