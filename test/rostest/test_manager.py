#!/usr/bin/env python3
"""The DroneManager alone, with a gateway that only listens, or none."""

from __future__ import annotations

import math
import time
import unittest

import rospy
import rostest
from rostest_support import LogWatch, call, wait_for

from drone_mesh.msg import RequestGatewayDroneFlight
from drone_mesh.srv import Casus, RequestDroneFlight


def request(node_id: int, latitude: float, longitude: float, height: int) -> int:
    place = (latitude, longitude, height)
    return call("/DroneManager/requestDroneMovement", RequestDroneFlight, node_id, *place).status


class ManagerTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls) -> None:
        rospy.init_node("test_manager")
        cls.log = LogWatch()

    def setUp(self) -> None:
        self.orders: list[RequestGatewayDroneFlight] = []
        self.gateway: rospy.Subscriber | None = None

    def tearDown(self) -> None:
        if self.gateway is not None:
            self.gateway.unregister()

    def listen(self) -> None:
        """Subscribe as a gateway does. Orders to drone 250 only show that they arrive."""
        trials: list[RequestGatewayDroneFlight] = []

        def order(order: RequestGatewayDroneFlight) -> None:
            (trials if order.ID == 250 else self.orders).append(order)

        self.gateway = rospy.Subscriber("/gateway", RequestGatewayDroneFlight, order)
        wait_for("no order arrived", 10, lambda: request(250, 1, 1, 1) == 1 and trials)

    def test_an_order_reaches_the_gateway_as_it_was_given(self) -> None:
        self.listen()
        self.assertEqual(request(3, 4.5, -2.25, 7), 1)
        wait_for("the order did not arrive", 5, lambda: self.orders)
        order = self.orders[0]
        self.assertEqual((order.ID, order.latitude, order.longitude), (3, 4.5, -2.25))
        self.assertEqual(order.height, 7)

    def test_without_a_gateway_the_status_is_0_after_3_seconds(self) -> None:
        begun_s = time.monotonic()
        self.assertEqual(request(3, 1, 1, 0), 0)
        self.assertTrue(2.5 < time.monotonic() - begun_s < 5.0)
        with self.assertRaisesRegex(rospy.ServiceException, "no gateway"):
            call("/DroneManager/SetToCasus", Casus, 101)

    def test_a_layout_is_ordered_from_the_highest_id_down(self) -> None:
        self.listen()
        call("/DroneManager/SetToCasus", Casus, 101)
        wait_for("six orders did not arrive", 5, lambda: len(self.orders) == 6)
        self.assertEqual(
            [(order.ID, order.longitude, order.latitude, order.height) for order in self.orders],
            [
                (6, 3, 16, 0),
                (5, -3, 16, 0),
                (4, 3, 10, 0),
                (3, -3, 10, 0),
                (2, 3, 4, 0),
                (1, -3, 4, 0),
            ],
        )

    def test_what_is_no_order_is_refused_with_a_reason(self) -> None:
        self.listen()
        for arguments, why in (
            ((3, math.nan, 1, 0), "latitude nan"),
            ((3, 1, math.inf, 0), "longitude inf"),
            ((3, 5001, 1, 0), "latitude 5001 m is outside"),
            ((3, 1, 1, -1), "height -1 m is outside"),
            ((3, 1, 1, 501), "height 501 m is outside"),
            ((254, 1, 1, 0), "invalid drone id 254: must be 0..253"),
            ((255, 1, 1, 0), "invalid drone id 255: must be 0..253"),
        ):
            with self.assertRaisesRegex(rospy.ServiceException, why):
                request(*arguments)
        with self.assertRaisesRegex(
            rospy.ServiceException, r"unknown case 99: use one of 0\.\.17, 100"
        ):
            call("/DroneManager/SetToCasus", Casus, 99)
        self.assertEqual(request(9, 1, 1, 1), 1)
        wait_for("the good order did not arrive", 5, lambda: self.orders)
        self.assertEqual([order.ID for order in self.orders], [9])
        self.assertEqual(self.log.failures(), [])


if __name__ == "__main__":
    rostest.rosrun("drone_mesh", "manager", ManagerTest)
