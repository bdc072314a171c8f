#!/usr/bin/env python3
"""With key:= the nodes of a simulation seal their packets, connect, and obey their gateway only."""

from __future__ import annotations

import signal
import subprocess
import tempfile
import unittest
from pathlib import Path

import rospy
import rostest
from rostest_support import WALL_LIMIT_S, MeshWatch, call, wait_for

from drone_mesh.communication.seals.keys import MeshKey, write_key_file
from drone_mesh.msg import NRF24
from drone_mesh.ros.graph import names
from drone_mesh.srv import RequestDroneFlight

FORGED_ORDER = bytes.fromhex("0000060101000020410000a04000000000").ljust(32, b"\0")  # to drone 1


class KeyTest(unittest.TestCase):
    def setUp(self) -> None:
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        key_file = Path(folder.name) / "mesh.key"
        write_key_file(key_file, MeshKey(bytes(range(16))))
        launch = subprocess.Popen(
            ["roslaunch", "drone_mesh", "factory.launch", "routers:=4", f"key:={key_file}"]
        )
        self.addCleanup(launch.wait)
        self.addCleanup(launch.send_signal, signal.SIGTERM)

    def test_an_order_from_the_gateway_is_obeyed_and_a_forged_one_is_not(self) -> None:
        rospy.init_node("test_key")
        heard: list[bytes] = []
        rospy.Subscriber(names.node_topic(1), NRF24, lambda message: heard.append(message.payload))
        forge = rospy.Publisher(names.node_topic(1), NRF24, queue_size=10)
        mesh = MeshWatch(5)
        wait_for("no clock", WALL_LIMIT_S, lambda: rospy.get_time() > 0.0)
        mesh.wait("all connected", 60, mesh.connected)
        mesh.wait("packets for node 1", 15, lambda: len(heard) > 10)
        of_others = [payload for payload in heard if payload[1] != 1]
        self.assertTrue(all(any(payload[25:]) for payload in of_others), "packets without a seal")
        # The subscriptions of this test and of node 1.
        wait_for("node 1 to hear the forger", WALL_LIMIT_S, lambda: forge.get_num_connections() > 1)
        place = mesh.place(1)
        for _ in range(5):
            forge.publish(NRF24(FORGED_ORDER))
        mesh.pass_time(5.0)
        self.assertEqual(mesh.place(1), place, "a forged order was obeyed")
        call("/DroneManager/requestDroneMovement", RequestDroneFlight, 1, 3.0, 2.0, 0)
        mesh.wait_at(1, 2.0, 3.0, 30)


if __name__ == "__main__":
    rostest.rosrun("drone_mesh", "key", KeyTest)
