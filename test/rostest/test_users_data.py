#!/usr/bin/env python3
"""Messages of users, from node to node."""

from __future__ import annotations

import unittest

import rospy
import rostest
from rostest_support import MeshWatch, call

from drone_mesh.msg import ReceivedData
from drone_mesh.srv import SendData

GATEWAY = 255


class UsersDataTest(unittest.TestCase):
    def test_a_message_of_a_thousand_bytes_arrives_and_its_sender_knows(self) -> None:
        rospy.init_node("test_users_data")
        mesh = MeshWatch(4)
        mesh.wait("all connected", 30, mesh.connected)
        received: list[ReceivedData] = []
        subscriber = rospy.Subscriber("/Nodes/0/received", ReceivedData, received.append)
        mesh.wait("node 0's topic", 10, lambda: subscriber.get_num_connections() == 1)
        payload = bytes(n % 256 for n in range(1024))
        answer = call("/Nodes/3/send", SendData, GATEWAY, 7, True, payload, 20.0)
        self.assertTrue(answer.success, answer.message)
        self.assertEqual(answer.message, "message 1 to the gateway: delivered")
        mesh.wait("the message on node 0's topic", 10, lambda: bool(received))
        message = received[0]
        self.assertEqual((message.sender, message.port, message.payload), (3, 7, payload))
        self.assertGreater(message.header.stamp.to_sec(), 0.0)
        refused = call("/Nodes/3/send", SendData, GATEWAY, 7, True, payload + b"!", 0.0)
        self.assertFalse(refused.success)
        self.assertIn("too large: 1025 bytes", refused.message)


if __name__ == "__main__":
    rostest.rosrun("drone_mesh", "users_data", UsersDataTest)
