#!/usr/bin/env python3
"""An order to a drone that the gateway cannot reach."""

from __future__ import annotations

import time
import unittest

import rospy
import rostest
from rostest_support import WALL_LIMIT_S, LogWatch, MeshWatch, call, wait_for

from drone_mesh.srv import RequestDroneFlight


class NoRouteTest(unittest.TestCase):
    def test_it_does_not_move_the_call_returns_and_the_log_names_it(self) -> None:
        rospy.init_node("test_no_route")
        log = LogWatch()
        mesh = MeshWatch(3)
        mesh.wait("all connected", 30, mesh.connected)
        start_place = mesh.place(2)
        mesh.switch(2, False)
        begun_s = time.monotonic()
        answer = call("/DroneManager/requestDroneMovement", RequestDroneFlight, 2, 4.0, 3.0, 0)
        self.assertLess(time.monotonic() - begun_s, WALL_LIMIT_S)
        # 1 as long as the gateway has its route over node 1, which then loses the order.
        said = {1: "no route to drone 2", 2: "drone 2: no gateway has a route to it"}
        wait_for("no line that names drone 2", 10, lambda: log.lines(said[answer.status]))
        mesh.wait(
            "0 and 1 know each other only",
            30,
            lambda: [mesh.info(node_id).familySize for node_id in (0, 1)] == [1, 1],
        )
        answer = call("/DroneManager/requestDroneMovement", RequestDroneFlight, 2, 4.0, 3.0, 0)
        self.assertEqual(answer.status, 2)
        mesh.pass_time(3.0)
        self.assertEqual(mesh.place(2), start_place)
        self.assertEqual(log.failures(), [])


if __name__ == "__main__":
    rostest.rosrun("drone_mesh", "no_route", NoRouteTest)
