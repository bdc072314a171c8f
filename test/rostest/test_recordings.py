#!/usr/bin/env python3
"""Recordings are played with one clock; of damaged ones, what can be read is shown."""

from __future__ import annotations

import itertools
import json
import os
import signal
import struct
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path
from typing import Sequence

import genpy
import rosbag
import rospy
import rostest
import websockets.exceptions
import websockets.sync.client
from mcap.reader import make_reader
from rosgraph_msgs.msg import Clock
from rostest_support import WALL_LIMIT_S, in_order, preload, run_program, wait_for
from test_tools import PLOTTING, gateway_record

from drone_mesh.drone.roles import Role
from drone_mesh.msg import MeshState, NodeState, PacketSample
from drone_mesh.ros.graph.conversions import ros_time, state_msg
from drone_mesh.state.model import MeshStatus, NodeStatus

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
        refused = run_program("replay", str(self.bag))
        self.assertIn(f"replay: {self.bag}: contains no /mesh/state", refused.stderr)
        self.assertNotIn("Traceback", refused.stderr)

    def test_2_time_moves_forwards_from_the_first_state_to_the_last(self) -> None:
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
        refused = run_program("replay", str(self.bag))
        self.assertIn("/mesh_replay already publishes /clock", refused.stderr)

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

    @unittest.skipIf(sys.version_info < (3, 10), "rosbags needs Python 3.10")
    def test_4_another_program_makes_mcap_of_it_that_others_can_open(self) -> None:
        record(self.bag)
        out = self.bag.with_name("run")
        how = ("--src", self.bag, "--dst", out, "--dst-storage", "mcap")
        subprocess.run([sys.executable, "-m", "rosbags.convert", *how], check=True)
        with (out / "run.mcap").open("rb") as file:
            summary = make_reader(file).get_summary()
        assert summary is not None
        assert summary.statistics is not None
        kinds = {number: summary.schemas[c.schema_id] for number, c in summary.channels.items()}
        counts = summary.statistics.channel_message_counts
        found = {c.topic: (kinds[n].name, counts[n]) for n, c in summary.channels.items()}
        states = int(LENGTH_S * 5)
        self.assertEqual(found["/mesh/state"], ("drone_mesh/msg/MeshState", states))
        self.assertEqual(found["/mesh/packets"], ("drone_mesh/msg/PacketSample", states))
        self.assertEqual(found["/clock"], ("rosgraph_msgs/msg/Clock", int(LENGTH_S * 100)))
        (state,) = (kind for kind in kinds.values() if kind.name == "drone_mesh/msg/MeshState")
        self.assertIn(b"MSG: drone_mesh/NodeState", state.data)  # which a viewer needs to read it


TOOLS = (
    ("status", "--bag", "{recording}"),
    ("snapshot", "--bag", "{recording}", "{folder}/damaged.png"),
    ("report", "{recording}", "-o", "{folder}/damaged.html"),
    ("flight_trace", "{recording}", "{folder}/damaged.csv"),
)


def flights(seconds: int) -> list[MeshStatus]:
    """A gateway, and a router that flies 1 m/s to the east."""
    gateway = NodeStatus(0, role=Role.GATEWAY, connected=True, on=True, position=(0.0, 0.0, 0.0))
    return [
        MeshStatus(
            float(s),
            [gateway, NodeStatus(3, connected=True, on=True, position=(float(s), 0.0, 5.0))],
        )
        for s in range(1, seconds + 1)
    ]


def record_runs(path: Path, *runs: list[MeshStatus]) -> None:
    """A bag of small chunks, recorded over restarts of the simulation."""
    with rosbag.Bag(str(path), "w", chunk_threshold=4096) as bag:
        for status in itertools.chain(*runs):
            bag.write("/mesh/state", state_msg(status), ros_time(status.stamp_s))


class DamagedRecordingTest(unittest.TestCase):
    def setUp(self) -> None:
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = Path(folder.name)

    def test_1_what_can_be_read_of_a_damaged_recording_is_shown(self) -> None:
        bag = self.folder / "run.bag"
        record_runs(bag, flights(100))
        whole = bag.read_bytes()
        middle = whole.index(struct.pack("<3f", 50.0, 0.0, 5.0))
        index = whole.index(b"op=\x04", middle)
        for damage in (bytes(400), bytes(b ^ 0x55 for b in whole[middle : middle + 400])):
            bag.write_bytes(whole[:middle] + damage + whole[middle + 400 :])
            self._look_into_damaged(bag, TOOLS if damage == bytes(400) else TOOLS[:1])
        bag.write_bytes(whole[: index - 4] + bytes(40) + whole[index + 36 :])
        self._look_into_damaged(bag, TOOLS[:1])
        record = self.folder / "flight.jsonl"
        lines = [json.loads(line) for line in gateway_record()]
        del lines[2]["events"], lines[3]["nodes"][1]["hops"]
        record.write_text("\ufeff" + "".join(f"{json.dumps(line)}\n" for line in lines))
        self._look_into_damaged(record, TOOLS)

    def _look_into_damaged(self, recording: Path, tools: Sequence[Sequence[str]]) -> None:
        for tool, *words in tools:
            named = [word.format(recording=recording, folder=self.folder) for word in words]
            finished = run_program(tool, *named)
            said = finished.stderr.splitlines()[-1]
            self.assertRegex(said, rf"^{tool}: .*: damaged at \d+\.0 s( to \d+\.0 s)?: \d+ mess")
            self.assertNotIn("Traceback", finished.stderr)
            self.assertEqual(finished.returncode, 2)
            self.assertTrue(finished.stdout, tool)

    def test_2_of_several_runs_in_one_recording_one_is_taken_and_told(self) -> None:
        bag, trace = self.folder / "runs.bag", self.folder / "runs.csv"
        record_runs(bag, flights(100), flights(30))
        last = run_program("status", "--bag", str(bag), "--at", "5")
        self.assertEqual(last.returncode, 0, last.stderr)
        self.assertIn("contains 2 runs", last.stderr)
        first = run_program("status", "--bag", str(bag), "--at", "99", "--run", "1")
        self.assertEqual((first.returncode, first.stderr), (0, ""))
        self.assertIn(" 99.0, 0.0, 5.0 ", first.stdout)
        self.assertIn(
            "ends at 30.0 s", run_program("status", "--bag", str(bag), "--at", "99").stderr
        )
        self.assertIn("2 drones, 29.0 s", run_program("flight_trace", str(bag), str(trace)).stdout)
        self.assertEqual(len(trace.read_text().splitlines()), 61)
        written = run_program("flight_trace", str(bag), str(trace), "--run", "1")
        self.assertIn("2 drones, 99.0 s", written.stdout, written.stderr)
        missing = run_program("flight_trace", str(bag), str(trace), "--run", "3")
        self.assertEqual(missing.returncode, 2)
        self.assertIn("no run 3; it contains 2", missing.stderr)


def suite() -> unittest.TestSuite:
    return in_order(ReplayTest, DamagedRecordingTest)


if __name__ == "__main__":
    preload(*PLOTTING, "drone_mesh.ros.views.ros_programs")
    rospy.init_node("test_recordings")
    rostest.rosrun("drone_mesh", "recordings", "__main__.suite")
