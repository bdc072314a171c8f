#!/usr/bin/env python3
"""A program hangs: simulated time goes on without it, the log names it, and it comes back.

A node outside this package flies the drones (drones:=external), and the world shows them.
"""

from __future__ import annotations

import contextlib
import math
import os
import signal
import time
import unittest
from typing import Iterator

import rosgraph
import rospy
import rostest
from rostest_support import WALL_LIMIT_S, LogWatch, MeshWatch, call, pid_of, wait_for

from drone_mesh.msg import MeshState
from drone_mesh.srv import RequestDroneFlight

GOES_ON_WITHIN_S = 15.0  # wall: 2 s for each thing that does not answer, on a busy machine


@contextlib.contextmanager
def hanging(pid: int) -> Iterator[None]:
    os.kill(pid, signal.SIGSTOP)
    try:
        yield
    finally:
        os.kill(pid, signal.SIGCONT)


class HangsTest(unittest.TestCase):
    def setUp(self) -> None:
        rospy.init_node("test_hangs")
        self.log = LogWatch()
        self.mesh = MeshWatch(4)
        self.states: list[MeshState] = []
        rospy.Subscriber("/mesh/state", MeshState, self.states.append)
        self.mesh.wait("all connected", 200, self.mesh.connected)

    def hang(self, pid: int | None, named: str = "") -> None:
        """`named`: what the log says about it."""
        assert pid is not None
        with hanging(pid):
            for _round in range(2):
                since_s, begun_s = rospy.get_time(), time.monotonic()
                wait_for(
                    "simulated time stands still",
                    GOES_ON_WITHIN_S,
                    lambda since_s=since_s: rospy.get_time() > since_s + 12.0,
                )
                print(f"12 simulated s took {time.monotonic() - begun_s:.1f} s")
            if named:
                wait_for(f"no line '{named}'", WALL_LIMIT_S, lambda: self.log.lines(named))
        self.mesh.forget(0, 1, 2, 3)
        self.mesh.wait("all connected again", 200, self.mesh.connected)
        x = 12.5 if self.mesh.place(3)[0] < 12.2 else 12.0

        def ordered() -> bool:
            answer = call("/DroneManager/requestDroneMovement", RequestDroneFlight, 3, 0.0, x, 0)
            return bool(answer.status == 1)

        self.mesh.wait("no order is taken any more", 100, ordered)
        self.mesh.wait_at(3, x, 0.0, within_s=100)
        self.mesh.wait("the world shows it there", 30, lambda: self.shown_at(3, x, 0.0))
        self.assertEqual(self.log.failures(), [])

    def shown_at(self, drone: int, x: float, y: float) -> bool:
        nodes = {node.id: node for node in self.states[-1].nodes} if self.states else {}
        return drone in nodes and math.dist(nodes[drone].position[:2], (x, y)) < 0.1

    def test_the_process_that_flies_the_drones(self) -> None:
        self.hang(pid_of("/drones_of_others"), "/drones_of_others does not answer")

    def test_the_simulator(self) -> None:
        self.hang(pid_of("/SimpleSimulator"), "lost the simulator")

    def test_a_host(self) -> None:
        self.hang(pid_of("/mesh_host_3_3"), "host /mesh_host_3_3 is silent")

    def test_the_manager(self) -> None:
        self.hang(pid_of("/DroneManager"))

    def test_the_console(self) -> None:
        self.hang(pid_of("/mesh_console"))

    def test_the_master(self) -> None:
        self.hang(rosgraph.Master("/test_hangs").getPid())


if __name__ == "__main__":
    rostest.rosrun("drone_mesh", "hangs", HangsTest)
