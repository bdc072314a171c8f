#!/usr/bin/env python3
"""A host and a manager outlive their world: in the next one nodes begin anew, and nobody flies."""

from __future__ import annotations

import contextlib
import signal
import subprocess
import unittest
from typing import Iterator

import rospy
import rostest
from rostest_support import WALL_LIMIT_S, LogWatch, MeshWatch, call, pid_of, wait_for

from drone_mesh.msg import Location
from drone_mesh.srv import OrderFormation, RequestDroneFlight

ARGUMENTS = ("routers:=3", "hosts:=0", "manager:=false", "real_time_factor:=5")
SURVIVORS = ("/DroneManager", "/mesh_host_0_2")


@contextlib.contextmanager
def world() -> Iterator[None]:
    """One world on the master that persists. Its fourth drone has no node."""
    launch = subprocess.Popen(["roslaunch", "drone_mesh", "factory.launch", *ARGUMENTS])
    try:
        yield
    finally:
        launch.send_signal(signal.SIGINT)
        launch.wait(timeout=WALL_LIMIT_S)


class WorldRestartTest(unittest.TestCase):
    def test_nodes_begin_anew_and_old_orders_are_void(self) -> None:
        rospy.init_node("test_world_restart")
        log = LogWatch()
        mesh = MeshWatch(3)
        with world():
            mesh.wait("all connected", 60, mesh.connected)
            start = mesh.place(2)
            call("/DroneManager/requestDroneMovement", RequestDroneFlight, 2, 4.0, 3.0, 0)
            mesh.wait_at(2, 3.0, 4.0, within_s=60)
            call(  # drone 3 has no node: the rest of this order waits for ever
                "/DroneManager/orderFormation",
                OrderFormation,
                "far",
                [1, 3],
                [Location(5.0, 5.0, 0), Location(8.0, 8.0, 0)],
                False,
                [],
            )
            mesh.wait_at(1, 5.0, 5.0, within_s=60)
            mesh.pass_time(40)
            sent = mesh.info(2).totalMessages
            pids = [pid_of(node) for node in SURVIVORS]
        over_s = rospy.get_time()
        with world():
            wait_for("a new clock", WALL_LIMIT_S, lambda: 0.0 < rospy.get_time() < over_s)
            mesh.forget(0, 1, 2)
            mesh.wait("all connected in the new world", 200, mesh.connected)
            self.assertLess(mesh.info(2).totalMessages, sent, "it still counts as before")
            mesh.pass_time(40)
            self.assertEqual(mesh.place(2), start, "an order of the world before was flown")
            self.assertNotEqual(mesh.place(1)[:2], (5.0, 5.0))
            call("/DroneManager/requestDroneMovement", RequestDroneFlight, 2, 3.0, 4.0, 0)
            mesh.wait_at(2, 4.0, 3.0, within_s=60)
        self.assertEqual(
            [pid_of(node) for node in SURVIVORS], pids, "roslaunch would say that they died"
        )
        said = [f"another world has begun: {node} begins anew" for node in SURVIVORS]
        self.assertEqual(sorted(log.lines("another world has begun")), said)
        self.assertEqual(log.failures(), [])


if __name__ == "__main__":
    rostest.rosrun("drone_mesh", "world_restart", WorldRestartTest)
