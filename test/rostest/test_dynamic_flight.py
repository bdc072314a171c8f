#!/usr/bin/env python3
"""flight:=dynamic: physics moves the drones, in a wind, and they still carry out orders."""

from __future__ import annotations

import unittest

import rospy
import rostest
from rostest_support import LogWatch, MeshWatch, call

from drone_mesh.srv import RequestDroneFlight


class DynamicFlightTest(unittest.TestCase):
    def test_an_order_is_flown_against_the_wind_and_the_mesh_is_whole_again(self) -> None:
        rospy.init_node("test_dynamic_flight")
        log = LogWatch()
        mesh = MeshWatch(4)
        mesh.wait("all connected at the start", 60, mesh.connected)
        call("/DroneManager/requestDroneMovement", RequestDroneFlight, 1, 4.0, 5.0, 0)
        mesh.wait(
            "drone 1 within half a metre of its goal, on the ground",
            90,
            lambda: self._is_near(mesh.place(1), (5.0, 4.0)),
        )
        mesh.wait("connected again", 60, mesh.connected)
        self.assertEqual(log.lines("crashed"), [])
        self.assertEqual(log.failures(), [])

    @staticmethod
    def _is_near(place: tuple[float, float, int], goal: tuple[float, float]) -> bool:
        x, y, height = place
        return abs(x - goal[0]) < 0.5 and abs(y - goal[1]) < 0.5 and height == 0


if __name__ == "__main__":
    rostest.rosrun("drone_mesh", "dynamic_flight", DynamicFlightTest)
