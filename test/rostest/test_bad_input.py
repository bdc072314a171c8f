#!/usr/bin/env python3
"""Random packets from a stranger: no node crashes or moves, and all still answer."""

from __future__ import annotations

import random
import unittest

import rospy
import rostest
from rostest_support import LogWatch, MeshWatch, Stranger

from drone_mesh.msg import NRF24
from drone_mesh.srv import WirelessMessage

PACKETS = 10_000
ME, GATEWAY, ROUTER = 100, 0, 1
REQUESTLOCATION, LOCATION, MOVE_TO_LOCATION = 2, 1, 6
SEED = 14


def random_packet(rng: random.Random, receiver: int) -> bytes:
    """Half of them random bytes, half of them a valid header with a random body."""
    packet = bytearray(rng.randrange(256) for _ in range(32))
    if rng.random() < 0.5:
        packet[:5] = bytes((ME, ME, rng.randrange(8), receiver, rng.choice((receiver, 254))))
    if packet[2] == MOVE_TO_LOCATION:
        packet[2] = 128
    return bytes(packet)


class BadInputTest(unittest.TestCase):
    def test_ten_thousand_random_packets(self) -> None:
        rospy.init_node("test_bad_input")
        log = LogWatch()
        mesh = MeshWatch(3)
        mesh.wait("all connected", 30, mesh.connected)
        places = [mesh.place(node_id) for node_id in range(3)]
        stranger = Stranger(ME, "/stranger", (0.5, 0.5, 0.1))
        stranger.register()

        rng = random.Random(SEED)
        service = rospy.ServiceProxy("/SignalSimulator/message", WirelessMessage, persistent=True)
        for number in range(PACKETS):
            receiver = (GATEWAY, ROUTER)[number % 2]
            message = NRF24(random_packet(rng, receiver))
            self.assertTrue(service(ME, receiver, message).succes, f"packet {number} was lost")

        for receiver in (GATEWAY, ROUTER):
            stranger.heard.clear()
            self.assertTrue(stranger.send(bytes((ME, ME, REQUESTLOCATION, receiver, receiver))))
            stranger.wait_for_packet(bytes((receiver, receiver, LOCATION, ME, ME)), "no answer")
        mesh.wait("all connected after it", 60, mesh.connected)
        self.assertEqual([mesh.place(node_id) for node_id in range(3)], places)
        self.assertEqual(log.failures(), [])


if __name__ == "__main__":
    rostest.rosrun("drone_mesh", "bad_input", BadInputTest)
