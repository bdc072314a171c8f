#!/usr/bin/env python3
"""Layout 0, the field case: 17 drones fly to their places and the mesh closes again."""

from __future__ import annotations

import unittest

import rospy
import rostest
from rostest_support import WALL_LIMIT_S, LogWatch, MeshWatch, call, wait_for

from drone_mesh.msg import LayoutProgress, Location
from drone_mesh.srv import OrderLayout

PLACES = {  # longitude, latitude: data of the project plan's field case
    1: (-13, 24), 2: (-11, 20), 3: (-12, 14), 4: (-7, 16), 5: (-12, 7), 6: (-7, 12),
    7: (-9, 5), 8: (-5, 10), 9: (-5, 5), 10: (4, 9), 11: (5, 5), 12: (7, 13),
    13: (9, 7), 14: (8, 20), 15: (5, 25), 16: (11, 25), 17: (8, 26.5),
}  # fmt: skip
LONGEST_FLIGHT_S = 30.0


class LayoutTest(unittest.TestCase):
    def test_1_each_drone_flies_to_its_place_and_is_connected_again(self) -> None:
        rospy.init_node("test_layout")
        log = LogWatch()
        mesh = MeshWatch(18)
        mesh.wait("all connected at the start", 30, mesh.connected)
        mesh.set_to_case(0)
        for node_id, place in sorted(PLACES.items()):
            mesh.wait_at(node_id, *place, within_s=LONGEST_FLIGHT_S)
        mesh.wait("all connected after the landing", 60, mesh.connected)
        self.assertEqual(log.failures(), [])

    def test_2_a_subscriber_that_comes_late_still_gets_the_goal(self) -> None:
        """The engine's connection may take a second more than the order."""
        goal = rospy.wait_for_message("/Drones/13/goal", Location, WALL_LIMIT_S)
        self.assertEqual((goal.longitude, goal.latitude, goal.height), (9.0, 7.0, 0))

    def test_3_a_drone_is_not_replaced_by_its_own_order_whatever_its_decimals(self) -> None:
        heard: list[LayoutProgress] = []
        rospy.Subscriber("/DroneManager/layouts", LayoutProgress, heard.append)
        number = call("/DroneManager/orderLayout", OrderLayout, 7000, False).id
        progress: list[LayoutProgress] = []

        def is_over() -> bool:
            progress[:] = [p for p in list(heard) if p.id == number and p.over]
            return bool(progress)

        wait_for("the layout is over", 2 * WALL_LIMIT_S, is_over)
        self.assertEqual(bytes(progress[-1].arrived), bytes([1, 17]), progress[-1].message)


if __name__ == "__main__":
    rostest.rosrun("drone_mesh", "layout", LayoutTest)
