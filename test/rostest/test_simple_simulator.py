#!/usr/bin/env python3
"""Antennas work with a simulator that offers only `message` and `othersinRange`."""

from __future__ import annotations

import unittest

import rosgraph
import rospy
import rostest
from rostest_support import LogWatch, MeshWatch


class SimpleSimulatorTest(unittest.TestCase):
    def test_the_mesh_connects_over_hops_and_notices_a_node_that_is_off(self) -> None:
        rospy.init_node("test_simple_simulator")
        log = LogWatch()
        mesh = MeshWatch(4)
        shortest = {0: 0, 1: 1, 2: 1, 3: 2}
        mesh.wait("all connected over the shortest routes", 60, lambda: mesh.hops() == shortest)
        _publishers, _subscribers, services = rosgraph.Master("/test").getSystemState()
        offered = {name for name, _nodes in services if name.startswith("/SignalSimulator/")}
        self.assertEqual(offered, {"/SignalSimulator/message", "/SignalSimulator/othersinRange"})
        ours = {node for _name, nodes in services for node in nodes}
        self.assertEqual(ours & {"/WirelessSignalSimulator", "/DroneManager"}, set())
        mesh.switch(2, False)
        mesh.wait("3, which is behind 2, lost", 30, lambda: mesh.lost(3))
        mesh.switch(2, True)
        mesh.wait("all connected again", 60, mesh.connected)
        self.assertEqual(log.failures(), [])


if __name__ == "__main__":
    rostest.rosrun("drone_mesh", "simple_simulator", SimpleSimulatorTest)
