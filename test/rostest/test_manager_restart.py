#!/usr/bin/env python3
"""The DroneManager is killed during a run; orders work again after its restart."""

from __future__ import annotations

import unittest

import rospy
import rostest
from rostest_support import LogWatch, MeshWatch, call, kill_and_wait_for_respawn

from drone_mesh.srv import RequestDroneFlight


class ManagerRestartTest(unittest.TestCase):
    def test_an_order_to_the_manager_that_came_back_moves_a_drone(self) -> None:
        rospy.init_node("test_manager_restart")
        log = LogWatch()
        mesh = MeshWatch(3)
        mesh.wait("all connected", 30, mesh.connected)
        kill_and_wait_for_respawn("/DroneManager")

        def ordered() -> bool:
            try:
                answer = call(
                    "/DroneManager/requestDroneMovement", RequestDroneFlight, 2, 4.0, 3.0, 0
                )
            except rospy.ServiceException:
                return False  # the master may know the address of the dead one for a moment
            return bool(answer.status == 1)

        mesh.wait("the manager did not find the gateway", 40, ordered)
        mesh.wait_at(2, 3.0, 4.0, within_s=20)
        mesh.wait("0 and 1 connected", 2, lambda: mesh.connected([0, 1]))
        self.assertEqual(log.failures(), [])


if __name__ == "__main__":
    rostest.rosrun("drone_mesh", "manager_restart", ManagerRestartTest)
