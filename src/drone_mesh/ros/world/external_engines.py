"""ExternalEngines: other ROS nodes fly the drones; the world shows their positions."""

from __future__ import annotations

import math
from typing import Callable, Sequence

import rospy

from drone_mesh.msg import DroneInfo
from drone_mesh.ros.graph import names
from drone_mesh.ros.graph.conversions import NO_POSITION
from drone_mesh.world.drones import VirtualDrone


class ExternalEngines:
    """Subscribes /WirelessSignalSimulator (DroneInfo): reports of the nodes that fly the drones.

    Those nodes offer what an engine of the world offers: they subscribe /Drones/<id>/goal, offer
    /Drones/<id>/gps, and publish DroneInfo without `sub`. Callbacks run in threads of rospy.
    """

    def __init__(self, drones: Callable[[], Sequence[VirtualDrone]]) -> None:
        """`drones` returns all current drones."""
        self._drones = drones
        rospy.Subscriber(
            names.SIGNAL_TOPIC, DroneInfo, self._reported, queue_size=names.SIGNAL_QUEUE
        )

    def _reported(self, info: DroneInfo) -> None:
        x, y, z = info.position
        has_position = (x, y, z) != NO_POSITION or info.on
        if info.sub or not has_position or not math.isfinite(x + y + z):
            return
        for drone in self._drones():
            if drone.node_id == info.nodeID:
                drone.engine.follow((x, y, z))
