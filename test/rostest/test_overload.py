#!/usr/bin/env python3
"""On an overloaded machine the mesh is slower, but not different."""

from __future__ import annotations

import contextlib
import os
import subprocess
import sys
import time
import unittest
from typing import Iterator

import rospy
import rostest
from rostest_support import wait_for

from drone_mesh.msg import MeshEvent, MeshState

DRONES = 50
START_S = 100.0  # wall
SIMULATED_S = 11.0  # each node checks its connection at least once
WITHIN_S = 120.0  # wall; an eighth of full speed


@contextlib.contextmanager
def busy_loops(count: int) -> Iterator[None]:
    """`count` processes that loop without waiting.

    Each has its own session; otherwise the kernel's autogroups would give all of them together only
    one share of the processor time.
    """
    command = [sys.executable, "-c", "while True: pass"]
    loops = [subprocess.Popen(command, start_new_session=True) for _ in range(count)]
    try:
        yield
    finally:
        for loop in loops:
            loop.kill()
        for loop in loops:
            loop.wait()


class OverloadTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls) -> None:
        rospy.init_node("test_overload")
        cls.state: MeshState | None = None
        cls.lost: list[str] = []
        rospy.Subscriber("/mesh/state", MeshState, cls._hear)
        rospy.Subscriber("/mesh/events", MeshEvent, cls._heard)

    @classmethod
    def _hear(cls, state: MeshState) -> None:
        cls.state = state

    @classmethod
    def _heard(cls, event: MeshEvent) -> None:
        if event.kind in ("disconnected", "neighbour lost"):
            cls.lost.append(f"{event.kind} {event.node}")

    def connected(self) -> bool:
        state = self.state
        return state is not None and sum(node.connected for node in state.nodes) == DRONES

    def test_no_connection_is_lost_on_a_machine_with_twice_as_much_to_do_as_it_can(self) -> None:
        wait_for("all connected", START_S, self.connected)
        self.lost.clear()
        with busy_loops(2 * (os.cpu_count() or 1)):
            begun_s, begun_wall_s = rospy.get_time(), time.monotonic()
            wait_for(
                f"{SIMULATED_S} simulated seconds",
                WITHIN_S,
                lambda: rospy.get_time() >= begun_s + SIMULATED_S,
            )
            factor = SIMULATED_S / (time.monotonic() - begun_wall_s)
        print(f"real-time factor {factor:.2f}")
        self.assertEqual(self.lost, [], "connections were lost")
        self.assertTrue(self.connected())


if __name__ == "__main__":
    rostest.rosrun("drone_mesh", "overload", OverloadTest)
