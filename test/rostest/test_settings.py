#!/usr/bin/env python3
"""Arguments of factory.launch that no other rostest sets, each by its effect."""

from __future__ import annotations

import math
import unittest

import rospy
import rostest
from rostest_support import LogWatch, MeshWatch, call

from drone_mesh.communication.wire.packet_types import MessageType
from drone_mesh.msg import Location, MeshState, PacketSample
from drone_mesh.srv import AreaScan, OrderFlight, OrderFormation


class SettingsTest(unittest.TestCase):
    def test_settings_reach_the_part_that_they_are_for(self) -> None:
        rospy.init_node("test_settings")
        log, mesh = LogWatch(), MeshWatch(4)
        types: set[int] = set()
        states: list[MeshState] = []
        rospy.Subscriber("/mesh/packets", PacketSample, lambda sample: types.update(sample.types))
        rospy.Subscriber("/mesh/state", MeshState, states.append)
        mesh.wait("all connected", 60, mesh.connected)
        near = call("/SignalSimulator/othersinRange", AreaScan, 1).near
        self.assertEqual(list(near), [0, 2, 3])
        self.assertEqual(list(call("/SignalSimulator/othersinRange", AreaScan, 3).near), [0, 1])
        mesh.wait("a state", 60, lambda: states)
        self.assertEqual((states[-1].max_distance, states[-1].shape), (5.0, "box"))

        def all_move() -> bool:
            return all(len(node.heading) for node in states[-1].nodes if node.id)

        mesh.wait("pilots that fly the routers", 60, all_move)
        for node in states[-1].nodes[1:]:
            start = (4.0 * ((node.id - 1) % 2), 4.0 * ((node.id - 1) // 2))
            self.assertLess(math.dist(node.position[:2], start), 1.0, "0.01 m/s is slow")
        places = [Location(8.0, 0.0, 0), Location(8.0, 1.5, 0)]
        with self.assertRaisesRegex(rospy.ServiceException, "1.50 m apart: the clearance is 2 m"):
            call("/DroneManager/orderFormation", OrderFormation, "a", [1, 2], places, False, [])
        with self.assertRaisesRegex(rospy.ServiceException, "drone 0 stands 1.5 m from there"):
            call("/DroneManager/orderFlight", OrderFlight, 2, 1.5, -1.0, 0, False)
        mesh.wait("a report", 90, lambda: MessageType.NODE_REPORT in types)
        mesh.switch(0, False)
        mesh.wait("router 1 is cut off", 60, lambda: mesh.lost(1))
        mesh.wait("its repair", 60, lambda: math.isfinite(states[-1].nodes[1].emergency_in))
        self.assertTrue(30.0 < states[-1].nodes[1].emergency_in <= 100.0)
        self.assertEqual(log.failures(), [])


if __name__ == "__main__":
    rostest.rosrun("drone_mesh", "settings", SettingsTest)
