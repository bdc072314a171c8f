#!/usr/bin/env python3
"""Recordings that are damaged, or that contain several runs; without a simulation."""

from __future__ import annotations

import itertools
import json
import struct
import tempfile
import unittest
from pathlib import Path
from typing import Sequence

import rosbag
import rospy
import rostest
from rostest_support import run_program
from test_tools import gateway_record

from drone_mesh.drone.roles import Role
from drone_mesh.ros.graph.conversions import ros_time, state_msg
from drone_mesh.state.model import MeshStatus, NodeStatus

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


if __name__ == "__main__":
    rospy.init_node("test_damaged_recording")
    rostest.rosrun("drone_mesh", "damaged_recording", DamagedRecordingTest)
