"""What the processes that fly the drones report: where each drone is, and which cannot fly."""

from __future__ import annotations

import struct

import rospy

from drone_mesh.drone.flight_path import Vector
from drone_mesh.msg import GroundedDrones as GroundedDronesMsg
from drone_mesh.ros.graph import names
from drone_mesh.ros.graph.conversions import NO_POSITION

_ID_POSITION_SUB_BYTES = struct.Struct("<B3fI")  # how a DroneInfo begins on the wire


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


class ReportedPlaces:
    """Subscribes: /WirelessSignalSimulator (DroneInfo). Any thread may ask.

    Reads only the beginning of each message: a fleet in flight sends thousands in a second.
    """

    def __init__(self) -> None:
        self._reported: dict[int, Vector] = {}  # rospy's thread replaces values, never the dict
        self._subscriber = rospy.Subscriber(
            names.SIGNAL_TOPIC, rospy.AnyMsg, self._heard, queue_size=names.SIGNAL_QUEUE
        )

    def place_of(self, node_id: int) -> Vector:
        """The last position, metres, that an engine reported for this drone; else NO_POSITION."""
        return self._reported.get(node_id, NO_POSITION)

    def _heard(self, message: rospy.AnyMsg) -> None:
        try:
            node_id, x, y, z, sub_bytes = _ID_POSITION_SUB_BYTES.unpack_from(message._buff)
        except struct.error:
            return
        if sub_bytes == 0 and (x, y, z) != NO_POSITION:
            self._reported[node_id] = (x, y, z)
