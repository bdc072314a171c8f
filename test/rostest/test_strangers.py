#!/usr/bin/env python3
"""A foreign node joins the mesh, with literal bytes; another sends random packets."""

from __future__ import annotations

import random
import struct
import unittest

import rospy
import rostest
from rostest_support import LogWatch, MeshWatch, Stranger

from drone_mesh.msg import NRF24
from drone_mesh.srv import WirelessMessage

PACKETS = 10_000
REQUESTLOCATION, LOCATION, HEARTBEAT, MOVE_TO_LOCATION = 2, 1, 4, 6
GATEWAY, ROUTER, RANDOM, ME = 0, 1, 100, 200
SEED = 14


def random_packet(rng: random.Random, receiver: int) -> bytes:
    """Half of them random bytes, half of them a valid header with a random body."""
    packet = bytearray(rng.randrange(256) for _ in range(32))
    if rng.random() < 0.5:
        packet[:5] = bytes(
            (RANDOM, RANDOM, rng.randrange(8), receiver, rng.choice((receiver, 254)))
        )
    if packet[2] == MOVE_TO_LOCATION:
        packet[2] = 128
    return bytes(packet)


class StrangersTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls) -> None:
        rospy.init_node("test_strangers")
        cls.log = LogWatch()
        cls.mesh = MeshWatch(3)

    def test_1_it_gets_a_location_and_a_heartbeat_from_the_gateway(self) -> None:
        log, mesh = self.log, self.mesh
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

    def test_2_ten_thousand_random_packets_crash_and_move_nobody_and_all_still_answer(self) -> None:
        log, mesh = self.log, self.mesh
        mesh.wait("all connected", 30, mesh.connected)
        places = [mesh.place(node_id) for node_id in range(3)]
        stranger = Stranger(RANDOM, "/stranger", (0.5, 0.5, 0.1))
        stranger.register()

        rng = random.Random(SEED)
        service = rospy.ServiceProxy("/SignalSimulator/message", WirelessMessage, persistent=True)
        for number in range(PACKETS):
            receiver = (GATEWAY, ROUTER)[number % 2]
            message = NRF24(random_packet(rng, receiver))
            self.assertTrue(service(RANDOM, receiver, message).succes, f"packet {number} was lost")

        for receiver in (GATEWAY, ROUTER):
            stranger.heard.clear()
            self.assertTrue(
                stranger.send(bytes((RANDOM, RANDOM, REQUESTLOCATION, receiver, receiver)))
            )
            stranger.wait_for_packet(
                bytes((receiver, receiver, LOCATION, RANDOM, RANDOM)), "no answer"
            )
        mesh.wait("all connected after it", 60, mesh.connected)
        self.assertEqual([mesh.place(node_id) for node_id in range(3)], places)
        self.assertEqual(log.failures(), [])


if __name__ == "__main__":
    rostest.rosrun("drone_mesh", "strangers", StrangersTest)
