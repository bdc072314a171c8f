#!/usr/bin/env python3
"""Messages of users, from node to node."""

from __future__ import annotations

import unittest

import rospy
import rostest
from rostest_support import MeshWatch, call

from drone_mesh.msg import MeshState, ReceivedData
from drone_mesh.srv import SendData

GATEWAY = 255


class UsersDataTest(unittest.TestCase):
    def test_a_message_of_a_thousand_bytes_arrives_and_its_sender_knows(self) -> None:
        rospy.init_node("test_users_data")
        mesh = MeshWatch(4)
        mesh.wait("all connected", 30, mesh.connected)
        received: list[ReceivedData] = []
        states: list[MeshState] = []
        rospy.Subscriber("/mesh/state", MeshState, states.append)
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

        def figures_show() -> bool:
            nodes = {node.id: node for node in states[-1].nodes} if states else {}
            if not {0, 3} <= set(nodes):
                return False
            return (nodes[3].data_sent, nodes[0].data_received) == (1, 1)

        mesh.wait("the message in /mesh/state", 10, figures_show)
        nodes = {node.id: node for node in states[-1].nodes}
        self.assertEqual((nodes[3].data_bytes_sent, nodes[0].data_bytes_received), (1024, 1024))
        self.assertLessEqual(nodes[3].data_sent_at, nodes[0].data_received_at)
        answer = call("/Nodes/3/send", SendData, 2, 7, True, b"across", 20.0)
        self.assertTrue(answer.success, answer.message)
        self.assertEqual(answer.message, "message 2 to node 2: delivered")
        refused = call("/Nodes/3/send", SendData, GATEWAY, 7, True, payload + b"!", 0.0)
        self.assertFalse(refused.success)
        self.assertIn("too large: 1025 bytes", refused.message)
        for wait in (-1.0, float("nan"), float("inf"), 301.0):
            refused = call("/Nodes/3/send", SendData, GATEWAY, 7, True, b"x", wait)
            self.assertFalse(refused.success)
            self.assertRegex(refused.message, r"invalid wait .*: must be 0\.\.300 seconds")
            self.assertEqual(refused.ticket, 0)


if __name__ == "__main__":
    rostest.rosrun("drone_mesh", "users_data", UsersDataTest)
