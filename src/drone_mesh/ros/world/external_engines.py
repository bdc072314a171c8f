"""ExternalEngines: the drones are flown by other ROS nodes, and the world shows where they are."""

from __future__ import annotations

import math
from typing import Sequence

import rospy

from drone_mesh.msg import DroneInfo
from drone_mesh.ros.graph import names
from drone_mesh.world.drones import VirtualDrone


class ExternalEngines:
    """Subscribes /WirelessSignalSimulator (DroneInfo): what the nodes that fly the drones report.

    Those nodes offer what an engine of the world would: they subscribe /Drones/<id>/goal, offer
    /Drones/<id>/gps, and publish DroneInfo without `sub`. Callbacks come in threads of rospy.
    """

    def __init__(self, drones: Sequence[VirtualDrone]) -> None:
        self._engines = {drone.node_id: drone.engine for drone in drones}
        rospy.Subscriber(
            names.SIGNAL_TOPIC, DroneInfo, self._reported, queue_size=names.SIGNAL_QUEUE
        )

    def _reported(self, info: DroneInfo) -> None:
        engine = self._engines.get(info.nodeID)
        x, y, z = info.position
        if engine is not None and not info.sub and info.on and math.isfinite(x + y + z):
            engine.follow((x, y, z))
