#!/usr/bin/env python3
"""The power switch of an antenna."""

from __future__ import annotations

import unittest

import rospy
import rostest
from rostest_support import LogWatch, MeshWatch, call

from drone_mesh.msg import NodeDebugInfo
from drone_mesh.srv import AreaScan


def near(node_id: int) -> list[int]:
    """The nodes that this one could send to."""
    return list(call("/SignalSimulator/othersinRange", AreaScan, node_id).near)


class PowerSwitchTest(unittest.TestCase):
    def test_a_node_that_is_switched_off_is_gone_and_comes_back(self) -> None:
        rospy.init_node("test_power_switch")
        log = LogWatch()
        mesh = MeshWatch(3)
        mesh.wait("all connected", 30, mesh.connected)
        heard: set[int] = set()
        of_all = rospy.Subscriber("/debug", NodeDebugInfo, lambda info: heard.add(info.nodeID))
        mesh.wait("all nodes on /debug", 10, lambda: heard == {0, 1, 2})
        of_all.unregister()
        mesh.switch(2, False)
        mesh.wait("2 off and not connected", 3, lambda: mesh.off(2) and mesh.hops()[2] is None)
        mesh.wait("2 off in the simulator", 3, lambda: near(1) == [0])
        sent = mesh.info(2).totalMessages
        mesh.pass_time(25.0)
        self.assertEqual(mesh.info(2).totalMessages, sent, "it sent something while off")
        mesh.wait("0 and 1 still connected", 2, lambda: mesh.connected([0, 1]))
        mesh.switch(2, True)
        mesh.wait("2 connected again", 5, lambda: not mesh.off(2) and mesh.connected())
        self.assertEqual(near(1), [0, 2])
        self.assertEqual(log.failures(), [])


if __name__ == "__main__":
    rostest.rosrun("drone_mesh", "power_switch", PowerSwitchTest)
