#!/usr/bin/env python3
"""The power switch of an antenna, and an order to a drone that the gateway cannot reach."""

from __future__ import annotations

import unittest

import rospy
import rostest
from rostest_support import LogWatch, MeshWatch, call, wait_for

from drone_mesh.msg import NodeDebugInfo
from drone_mesh.srv import AreaScan, RequestDroneFlight


def near(node_id: int) -> list[int]:
    """The nodes that this one could send to."""
    return list(call("/SignalSimulator/othersinRange", AreaScan, node_id).near)


class PowerSwitchTest(unittest.TestCase):
    def test_a_node_that_is_switched_off_is_gone_takes_no_order_and_comes_back(self) -> None:
        rospy.init_node("test_power_switch")
        log = LogWatch()
        mesh = MeshWatch(3)
        mesh.wait("all connected", 30, mesh.connected)
        heard: set[int] = set()
        of_all = rospy.Subscriber("/debug", NodeDebugInfo, lambda info: heard.add(info.nodeID))
        mesh.wait("all nodes on /debug", 10, lambda: heard == {0, 1, 2})
        of_all.unregister()
        start_place = mesh.place(2)
        mesh.switch(2, False)
        answer = call("/DroneManager/requestDroneMovement", RequestDroneFlight, 2, 4.0, 3.0, 0)
        # 1 as long as the gateway has its route over node 1, which then loses the order.
        said = {1: "no route to drone 2", 2: "drone 2: no gateway has a route to it"}
        mesh.wait("2 off and not connected", 3, lambda: mesh.off(2) and mesh.hops()[2] is None)
        mesh.wait("2 off in the simulator", 3, lambda: near(1) == [0])
        wait_for("no line that names drone 2", 10, lambda: log.lines(said[answer.status]))
        mesh.wait(
            "0 and 1 know each other only",
            30,
            lambda: [mesh.info(node_id).familySize for node_id in (0, 1)] == [1, 1],
        )
        answer = call("/DroneManager/requestDroneMovement", RequestDroneFlight, 2, 4.0, 3.0, 0)
        self.assertEqual(answer.status, 2)
        sent = mesh.info(2).totalMessages
        mesh.pass_time(25.0)
        self.assertEqual(mesh.info(2).totalMessages, sent, "it sent something while off")
        self.assertEqual(mesh.place(2), start_place)
        mesh.wait("0 and 1 still connected", 2, lambda: mesh.connected([0, 1]))
        mesh.switch(2, True)
        mesh.wait("2 connected again", 5, lambda: not mesh.off(2) and mesh.connected())
        self.assertEqual(near(1), [0, 2])
        self.assertEqual(log.failures(), [])


if __name__ == "__main__":
    rostest.rosrun("drone_mesh", "power_switch", PowerSwitchTest)
