#!/usr/bin/env python3
"""A foreign node joins the mesh, with literal bytes and on the first try."""

from __future__ import annotations

import struct
import unittest

import rospy
import rostest
from rostest_support import LogWatch, MeshWatch, Stranger

REQUESTLOCATION, LOCATION, HEARTBEAT = 2, 1, 4
ME = 200


class StrangerTest(unittest.TestCase):
    def test_it_gets_a_location_and_a_heartbeat_from_the_gateway(self) -> None:
        rospy.init_node("test_stranger")
        log = LogWatch()
        mesh = MeshWatch(3)
        shortest = {0: 0, 1: 1, 2: 1}  # the first routes need not be the shortest
        mesh.wait("all connected, over the shortest routes", 60, lambda: mesh.hops() == shortest)
        stranger = Stranger(ME, "/my/own/topic", (12.0, 0.0, 0.5))  # only router 2 hears it
        stranger.register()

        self.assertTrue(stranger.send(bytes((ME, ME, REQUESTLOCATION, 2, 2))))
        answer = stranger.wait_for_packet(bytes((2, 2, LOCATION, ME, ME)), "no location")
        latitude, longitude, height = struct.unpack_from("<ffh", answer, 5)
        self.assertEqual((latitude, longitude, height), (0.0, 6.0, 0))

        # A heartbeat that knows no gateway, over router 2 to gateway 0.
        self.assertTrue(stranger.send(bytes((ME, ME, HEARTBEAT, 2, 0, 0, 255, 0))))
        answer = stranger.wait_for_packet(bytes((0, 2, HEARTBEAT, ME, ME)), "no answer from 0")
        know_gateway, gateway, hops = answer[5:8]
        self.assertEqual((know_gateway, gateway), (1, 0))
        self.assertEqual(hops, 1)  # how often it was forwarded
        self.assertEqual(log.failures(), [])


if __name__ == "__main__":
    rostest.rosrun("drone_mesh", "stranger", StrangerTest)
