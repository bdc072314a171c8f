#!/usr/bin/env python3
"""A jammer with power cuts all drones off: they stay where they are, and connect again after it."""

from __future__ import annotations

import unittest

import rospy
import rostest
from rostest_support import LogWatch, MeshWatch
from std_msgs.msg import Bool

from drone_mesh.msg import MeshState


class JammerTest(unittest.TestCase):
    def test_jammed_drones_stay_say_so_and_connect_again(self) -> None:
        rospy.init_node("test_jammer")
        log = LogWatch()
        mesh = MeshWatch(4)
        states: list[MeshState] = []
        rospy.Subscriber("/mesh/state", MeshState, states.append, queue_size=1)
        jammer = rospy.Publisher("/jammer", Bool, latch=True, queue_size=1)
        mesh.wait("all connected at the start", 30, mesh.connected)
        before = [mesh.place(node) for node in (1, 2, 3)]
        jammer.publish(True)
        mesh.wait("all routers are cut off", 60, lambda: mesh.lost(1, 2, 3))

        def all_say_so() -> bool:
            routers = [node for node in states[-1].nodes if node.id != 0] if states else []
            return len(routers) == 3 and all("is jammed" in node.repair for node in routers)

        mesh.wait("all say that their channel is jammed", 90, all_say_so)
        self.assertTrue(all(node.jammed for node in states[-1].nodes if node.id != 0))
        mesh.pass_time(60.0)
        jammer.publish(False)
        mesh.wait("all connected again", 30, mesh.connected)
        self.assertEqual([mesh.place(node) for node in (1, 2, 3)], before)
        self.assertEqual(log.failures(), [])


if __name__ == "__main__":
    rostest.rosrun("drone_mesh", "jammer", JammerTest)
