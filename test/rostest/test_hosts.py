#!/usr/bin/env python3
"""The nodes are spread over three processes; one of them is killed and comes back."""

from __future__ import annotations

import os
import signal
import subprocess
import unittest

import rospy
import rostest
from rostest_support import WALL_LIMIT_S, LogWatch, MeshWatch, call, pid_of, program, wait_for

from drone_mesh.srv import AddDrone, RemoveDrone


class HostsTest(unittest.TestCase):
    def test_only_the_drones_of_a_killed_host_are_lost_and_they_rejoin(self) -> None:
        rospy.init_node("test_hosts")
        log = LogWatch()
        mesh = MeshWatch(18)  # ids 0..4, 5..9 and 10..14 in one host each; the others are added
        mesh.wait("all connected", 60, lambda: mesh.connected(range(15)))
        for host, latitude in ((1, 0.0), (2, 6.0), (3, 12.0)):
            added = call("/DroneFactory/addDrone", AddDrone, 255, False, latitude, 24.0)
            self.assertIn(f"/mesh_host_{host} runs its node", added.message)
        mesh.wait("the new ones connected", 60, mesh.connected)

        refused = subprocess.run(
            program("mesh_host", "__name:=second", "_first:=3", "_last:=4"),
            stderr=subprocess.PIPE,
            timeout=WALL_LIMIT_S,
            check=False,
            text=True,
        )
        self.assertNotEqual(refused.returncode, 0)
        self.assertIn("node 3 is already hosted by another process", refused.stderr)
        self.assertNotIn("Traceback", refused.stderr)

        # A restarted node counts from 0: it must have sent enough to be recognised.
        mesh.wait("14 has sent 40 messages", 90, lambda: mesh.info(14).totalMessages >= 40)
        old_pid = pid_of("/mesh_host_3")
        sent = mesh.info(14).totalMessages
        os.kill(old_pid, signal.SIGKILL)
        mesh.wait("the others stay connected", 1, lambda: mesh.connected(range(10)))
        wait_for("respawn", WALL_LIMIT_S, lambda: pid_of("/mesh_host_3") not in (None, old_pid))
        mesh.forget(10, 11, 12, 13, 14, 17)  # what they reported before their death
        mesh.wait("14 restarted", 60, lambda: 14 in mesh.hops())
        self.assertLess(mesh.info(14).totalMessages, sent, "it still counts as before")
        mesh.wait("the nodes of host 3 connected again", 60, mesh.connected)
        removed = call("/DroneFactory/removeDrone", RemoveDrone, 17)  # in the restarted host
        self.assertTrue(removed.success, removed.message)
        with self.assertRaises(rospy.ROSException):
            rospy.wait_for_service("/Nodes/17/powerSwitch", timeout=0.1)
        self.assertEqual(log.failures(), [])


if __name__ == "__main__":
    rostest.rosrun("drone_mesh", "hosts", HostsTest)
