#!/usr/bin/env python3
"""replay.launch plays a recorded run with one clock, which never runs backwards."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import tempfile
import unittest
from pathlib import Path

import genpy
import rosbag
import rospy
import rostest
import websockets.exceptions
import websockets.sync.client
from rosgraph_msgs.msg import Clock
from rostest_support import WALL_LIMIT_S, wait_for

from drone_mesh.msg import MeshState, NodeState, PacketSample

BEGIN_S, LENGTH_S = 100.0, 4.0
PORT = 18182


def record(path: Path) -> None:
    """A bag as record.launch makes it: recorded times and /clock lie a little apart."""
    with rosbag.Bag(str(path), "w") as bag:
        for tick in range(int(LENGTH_S * 100)):
            now = genpy.Time.from_sec(BEGIN_S + tick * 0.01)
            arrived = genpy.Time.from_sec(BEGIN_S + tick * 0.01 + 0.03 * (tick % 3))
            bag.write("/clock", Clock(now), arrived)
            if tick % 20 == 0:
                state = MeshState(nodes=[NodeState(id=0)])
                state.header.stamp = now
                bag.write("/mesh/state", state, arrived)
                bag.write("/mesh/packets", PacketSample(carried=1), arrived)


class ReplayTest(unittest.TestCase):
    def setUp(self) -> None:
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.bag = Path(folder.name, "run.bag")

    def launch(self, *arguments: str, console: bool = False) -> subprocess.Popen[str]:
        shown = f"console:={str(console).lower()}"
        process = subprocess.Popen(
            ["roslaunch", "drone_mesh", "replay.launch", shown, *arguments],
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            start_new_session=True,
            text=True,
        )
        self.addCleanup(process.wait, WALL_LIMIT_S)
        self.addCleanup(self.interrupt, process)
        return process

    @staticmethod
    def interrupt(process: subprocess.Popen[str]) -> None:
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGINT)

    def test_1_what_is_no_recording_of_a_mesh_is_refused_in_one_line(self) -> None:
        with rosbag.Bag(str(self.bag), "w") as bag:
            bag.write("/clock", Clock(genpy.Time(1)), genpy.Time(1))
        output, _ = self.launch(f"bag:={self.bag}").communicate(timeout=60)
        self.assertIn(f"replay: {self.bag}: contains no /mesh/state", output)
        self.assertNotIn("Traceback", output)

    def test_2_time_moves_forwards_from_the_first_state_to_the_last(self) -> None:
        rospy.init_node("test_replay")
        ticks: list[float] = []
        states: list[float] = []
        rospy.Subscriber("/clock", Clock, lambda tick: ticks.append(tick.clock.to_sec()))
        rospy.Subscriber("/mesh/state", MeshState, lambda s: states.append(s.header.stamp.to_sec()))
        record(self.bag)
        self.launch(f"bag:={self.bag}", "rate:=2")
        last_s = BEGIN_S + LENGTH_S - 0.2
        wait_for("the last state", 60, lambda: states and states[-1] >= last_s - 1e-6)
        wait_for("the clock at its end", WALL_LIMIT_S, lambda: ticks and ticks[-1] >= last_s)
        heard = list(ticks)  # more may arrive while this list is looked at
        self.assertEqual(heard, sorted(heard))
        self.assertGreaterEqual(heard[0], BEGIN_S - 0.1)
        refused, _ = self.launch(f"bag:={self.bag}").communicate(timeout=60)
        self.assertIn("/mesh_replay already publishes /clock", refused)

    def test_3_the_page_has_all_of_the_bag_on_its_time_line_while_it_is_played(self) -> None:
        record(self.bag)
        self.launch(f"bag:={self.bag}", "rate:=0.1", f"port:={PORT}", console=True)
        lines: list[dict] = []

        def looked() -> bool:
            try:
                with websockets.sync.client.connect(
                    f"ws://127.0.0.1:{PORT}/ws", origin=f"http://127.0.0.1:{PORT}", proxy=None
                ) as page:
                    lines.append(json.loads(page.recv(timeout=1.0)))
                    while lines[-1]["type"] != "timeline":
                        lines.append(json.loads(page.recv(timeout=1.0)))
            except (OSError, TimeoutError, websockets.exceptions.WebSocketException):
                return False
            return lines[-1]["end"] > BEGIN_S + LENGTH_S - 0.5 and lines[-1]["packets"]

        wait_for("the end of the bag and its packets on the time line", 60, looked)
        self.assertEqual(lines[-1]["start"], BEGIN_S)
        self.assertLess(lines[-1]["now"], BEGIN_S + LENGTH_S - 0.5)
        self.assertTrue(lines[-1]["live"])


if __name__ == "__main__":
    rostest.rosrun("drone_mesh", "replay", ReplayTest)
