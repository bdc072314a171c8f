#!/usr/bin/env python3
"""A program that sends far more orders than a mesh can carry."""

from __future__ import annotations

import time
import unittest

import rospy
import rostest
from rosgraph_msgs.msg import Clock
from rostest_support import LogWatch, MeshWatch, wait_for

from drone_mesh.msg import RequestGatewayDroneFlight

ORDERS = 4000
PER_S = 1000
LONGEST_PAUSE_S = 4.0  # wall; it was 9 s when each order was carried out and logged


class OrderFloodTest(unittest.TestCase):
    def test_the_world_goes_on_and_the_log_stays_readable(self) -> None:
        rospy.init_node("test_order_flood")
        log = LogWatch()
        MeshWatch(9).pass_time(1.0)
        seen_s = [time.monotonic()]
        rospy.Subscriber("/clock", Clock, lambda _clock: seen_s.append(time.monotonic()))
        gateway = rospy.Publisher("/gateway", RequestGatewayDroneFlight, queue_size=ORDERS)
        wait_for("the gateway subscribes", 10, gateway.get_num_connections)
        begun_s = time.monotonic()
        for number in range(ORDERS):
            gateway.publish(RequestGatewayDroneFlight(ID=1 + number % 8, latitude=5.0))
            time.sleep(max(0.0, begun_s + number / PER_S - time.monotonic()))
        refused = "order refused: for drone"
        wait_for("a line says that orders were refused", 20, lambda: log.lines(refused))
        so_far = len(seen_s)
        wait_for("the clock goes on", 20, lambda: len(seen_s) > so_far + 100)
        pauses = [later - earlier for earlier, later in zip(seen_s, seen_s[1:])]
        self.assertLess(max(pauses), LONGEST_PAUSE_S)
        self.assertLess(len(log.lines("order")), 50)
        self.assertEqual(log.failures(), [])


if __name__ == "__main__":
    rostest.rosrun("drone_mesh", "order_flood", OrderFloodTest)
