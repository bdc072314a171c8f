#!/usr/bin/env python3
"""Reacts to what happens in the mesh: reports each outage, and switches lost power on again.

While a simulation is running, after `source scripts/env.bash`: examples/react_to_events.py
"""

from __future__ import annotations

import rospy

from drone_mesh.msg import MeshEvent
from drone_mesh.srv import PowerSwitch

POWER_BACK_AFTER_S = 20.0  # simulated


class Caretaker:
    """Subscribes: /mesh/events (MeshEvent). Calls: /Nodes/<id>/powerSwitch (PowerSwitch)."""

    def __init__(self) -> None:
        self._lost_at: dict[int, rospy.Time] = {}
        rospy.Subscriber("mesh/events", MeshEvent, self._on_event)

    def _on_event(self, event: MeshEvent) -> None:
        if event.code == MeshEvent.DISCONNECTED:
            self._lost_at.setdefault(event.node, event.stamp)
        elif event.code == MeshEvent.CONNECTED and event.node in self._lost_at:
            outage = event.stamp - self._lost_at.pop(event.node)
            rospy.loginfo("node %d was without a gateway for %.1f s", event.node, outage.to_sec())
        elif event.code == MeshEvent.POWER_OFF:
            wait = rospy.Duration.from_sec(POWER_BACK_AFTER_S)
            rospy.Timer(wait, lambda _event: self._power_on(event.node), oneshot=True)

    def _power_on(self, node: int) -> None:
        rospy.ServiceProxy(f"Nodes/{node}/powerSwitch", PowerSwitch)(True)
        rospy.loginfo("switched node %d on again", node)


if __name__ == "__main__":
    rospy.init_node("caretaker")
    Caretaker()
    rospy.spin()
