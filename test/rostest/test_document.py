#!/usr/bin/env python3
"""A client that knows only what the original design names sees the same mesh in every world.

three_routers.test runs it against this package's own simulator and engines,
document_strangers.test against those of others.
"""

from __future__ import annotations

import unittest

import rospy
import rostest
from rostest_support import Stranger, call, wait_for

from drone_mesh import msg, srv
from drone_mesh.msg import NodeDebugInfo
from drone_mesh.srv import Casus, PowerSwitch, RequestDroneFlight, RequestGPS

WITHIN_S = 90  # wall
REQUESTLOCATION, LOCATION = 2, 1
STRANGER = 200
MD5_SUMS = {  # of 2019: programs built against those definitions still work
    msg.DroneInfo: "99e674e5b5a4182824586263d617f84a",
    msg.Location: "531a36c12f67bc070739cea93f21680c",
    msg.NRF24: "a180fb3b6d78327c70980534ae536e9c",
    msg.NodeDebugInfo: "b141338f1e7694ff1b6289d9fdd9b17d",
    msg.RequestGatewayDroneFlight: "cae8e186407a89969bcd102090752de9",
    srv.AreaScan: "ebc855433e55277d7ff08f155e929271",
    srv.Casus: "793016ca784a646cc1bb4549c63c4736",
    srv.PowerSwitch: "d1b2ea3f5a3f173007e2e47568b40871",
    srv.RequestDroneFlight: "51562573c0dba53c9030c27c5521346f",
    srv.RequestGPS: "531a36c12f67bc070739cea93f21680c",
    srv.WirelessMessage: "7675f18cd7ea62a81bf259a443d1ffd3",
}


class DocumentTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls) -> None:
        cls.debug: dict[int, NodeDebugInfo] = {}
        for node in range(4):
            rospy.Subscriber(f"/Nodes/{node}/debug", NodeDebugInfo, cls.heard)

    @classmethod
    def heard(cls, info: NodeDebugInfo) -> None:
        cls.debug[info.nodeID] = info

    def hops(self) -> dict[int, int]:
        return {n: i.hops for n, i in sorted(self.debug.items()) if i.ConnectedWithGateway}

    def wait_for_hops(self, *hops: int) -> None:
        expected = dict(enumerate(hops))
        wait_for(f"hops {expected}", WITHIN_S, lambda: self.hops() == expected)

    def place(self, drone: int) -> tuple[float, float]:
        place = call(f"/Drones/{drone}/gps", RequestGPS)
        return place.longitude, place.latitude

    def wait_for_place(self, drone: int, longitude: float, latitude: float) -> None:
        def is_there() -> bool:
            x, y = self.place(drone)
            return abs(x - longitude) + abs(y - latitude) < 0.1

        wait_for(f"drone {drone} at x {longitude}, y {latitude}", WITHIN_S, is_there)

    def test_0_the_definitions_are_those_of_2019(self) -> None:
        self.assertEqual({kind: kind._md5sum for kind in MD5_SUMS}, MD5_SUMS)

    def test_1_the_mesh_connects_and_a_layout_is_flown(self) -> None:
        self.wait_for_hops(0, 1, 1, 2)
        call("/DroneManager/SetToCasus", Casus, 201)
        for drone, latitude in ((1, 4.0), (2, 10.0), (3, 16.0)):
            self.wait_for_place(drone, -1.0, latitude)
        self.wait_for_hops(0, 1, 2, 3)

    def test_2_a_drone_is_sent_elsewhere_and_found_over_other_hops(self) -> None:
        def sets_out() -> bool:  # an order is lost, silently, as long as there is no route to 3
            call("/DroneManager/requestDroneMovement", RequestDroneFlight, 3, 5.0, 4.0, 0)
            return self.place(3)[1] < 15.8

        wait_for("drone 3 leaves for the place that it is sent to", WITHIN_S, sets_out)
        self.wait_for_place(3, 4.0, 5.0)
        self.wait_for_hops(0, 1, 2, 1)

    def test_3_a_switch_silences_a_node(self) -> None:
        call("/Nodes/3/powerSwitch", PowerSwitch, False)
        wait_for("3 is not connected", WITHIN_S, lambda: 3 not in self.hops())
        self.assertFalse(self.debug[3].on)
        call("/Nodes/3/powerSwitch", PowerSwitch, True)
        self.wait_for_hops(0, 1, 2, 1)

    def test_4_a_foreign_antenna_gets_the_place_of_its_neighbour(self) -> None:
        stranger = Stranger(STRANGER, "/some/topic", (4.0, 6.0, 0.5))
        stranger.register()
        self.addCleanup(stranger.leave)
        self.assertTrue(stranger.send(bytes((STRANGER, STRANGER, REQUESTLOCATION, 3, 3))))
        stranger.wait_for_packet(bytes((3, 3, LOCATION, STRANGER, STRANGER)), "no location")


if __name__ == "__main__":
    rospy.init_node("test_document")
    rostest.rosrun("drone_mesh", "document", DocumentTest)
