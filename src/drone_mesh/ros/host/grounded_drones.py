"""GroundedDrones: which drones would not fly now, as the process that flies them says."""

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
        """Why this drone would not fly now; empty: it would, or that is not known."""
        return self._reasons.get(node_id, "")

    def stop(self) -> None:
        """Leave the topic."""
        self._subscriber.unregister()

    def _changed(self, message: GroundedDronesMsg) -> None:
        self._reasons = dict(zip(message.ids, message.reasons))
