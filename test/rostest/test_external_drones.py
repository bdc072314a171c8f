#!/usr/bin/env python3
"""drones:=external: a node outside this package flies the drones, and the world shows them."""

from __future__ import annotations

import unittest

import rospy
import rostest
from rostest_support import LogWatch, MeshWatch, call

from drone_mesh.msg import MeshState
from drone_mesh.srv import RequestDroneFlight


class ExternalDronesTest(unittest.TestCase):
    def test_an_order_is_flown_by_the_other_node_and_seen_in_the_world(self) -> None:
        rospy.init_node("test_external_drones")
        log = LogWatch()
        mesh = MeshWatch(4)
        mesh.wait("all connected at the start", 60, mesh.connected)
        call("/DroneManager/requestDroneMovement", RequestDroneFlight, 1, 4.0, 5.0, 0)
        seen = []
        rospy.Subscriber("/mesh/state", MeshState, seen.append)
        mesh.wait_at(1, 5.0, 4.0, within_s=60)
        mesh.wait(
            "the world shows it there",
            30,
            lambda: any(
                node.id == 1
                and abs(node.position[0] - 5.0) < 0.1
                and abs(node.position[1] - 4) < 0.1
                for node in (seen[-1].nodes if seen else ())
            ),
        )
        mesh.wait("connected again", 60, mesh.connected)
        self.assertEqual(log.failures(), [])


if __name__ == "__main__":
    rostest.rosrun("drone_mesh", "external_drones", ExternalDronesTest)
