#!/usr/bin/env python3
"""The examples that are ROS nodes: one follows an order, one reacts to events."""

from __future__ import annotations

import subprocess
import sys
import unittest
from pathlib import Path

import rospy
import rostest
from rostest_support import WALL_LIMIT_S, call, receives, wait_for

from drone_mesh.msg import MeshState
from drone_mesh.srv import PowerSwitch

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"


class ExamplesTest(unittest.TestCase):
    def setUp(self) -> None:
        if not rospy.core.is_initialized():
            rospy.init_node("test_examples")
        self.state: MeshState | None = None
        rospy.Subscriber("/mesh/state", MeshState, self._on_state)
        wait_for("all connected", WALL_LIMIT_S, lambda: self.connected() == [0, 1, 2])

    def _on_state(self, state: MeshState) -> None:
        self.state = state

    def connected(self) -> list[int]:
        nodes = self.state.nodes if self.state else []
        return [node.id for node in nodes if node.connected and node.on]

    def start(self, *command: str) -> subprocess.Popen[str]:
        process = subprocess.Popen(
            [sys.executable, str(EXAMPLES / command[0]), *command[1:]],
            stdout=subprocess.PIPE,
            text=True,
        )
        self.addCleanup(process.wait, WALL_LIMIT_S)
        self.addCleanup(process.terminate)
        return process

    def test_1_an_order_is_followed_until_the_drone_has_arrived(self) -> None:
        follower = self.start("fly_and_follow.py", "2", "6", "3")
        printed, _ = follower.communicate(timeout=WALL_LIMIT_S)
        self.assertEqual(follower.returncode, 0, printed)
        self.assertIn("the drone has accepted it", printed)
        self.assertIn("the drone has arrived", printed)

    def test_2_a_node_that_was_switched_off_is_switched_on_again(self) -> None:
        self.start("react_to_events.py")
        wait_for(
            "the example's subscription",
            WALL_LIMIT_S,
            lambda: receives("/caretaker", "/mesh/events", "/DroneFactory"),
        )
        call("/Nodes/1/powerSwitch", PowerSwitch, False)
        wait_for("1 is off", WALL_LIMIT_S, lambda: self.state and not self.state.nodes[1].on)
        wait_for("1 is on again", WALL_LIMIT_S, lambda: self.state.nodes[1].on)


if __name__ == "__main__":
    rostest.rosrun("drone_mesh", "test_examples", ExamplesTest)
