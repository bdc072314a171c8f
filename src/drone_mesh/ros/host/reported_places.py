"""ReportedPlaces: where the engines of other processes say that their drones are."""

from __future__ import annotations

import struct

import rospy

from drone_mesh.drone.flight_path import Vector
from drone_mesh.ros.graph import names
from drone_mesh.ros.graph.conversions import NO_POSITION

_ID_POSITION_SUB_BYTES = struct.Struct("<B3fI")  # how a DroneInfo begins on the wire


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
