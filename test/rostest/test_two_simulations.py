#!/usr/bin/env python3
"""Two simulations on one master, each in a namespace; the second in a group, and stopped first."""

from __future__ import annotations

import re
import signal
import subprocess
import tempfile
import time
import unittest
from pathlib import Path

import rosbag
import rosgraph
import rospy
import rostest
from rosgraph_msgs.msg import Clock
from rostest_support import (
    CLOCK_REST_S,
    WALL_LIMIT_S,
    call,
    pid_of,
    preload,
    program,
    receives,
    run_program,
    wait_for,
)

from drone_mesh.msg import MeshState
from drone_mesh.srv import Casus, RequestGPS, SetSpeed

SITE_B = """<launch><group ns="site_b"><include file="$(find drone_mesh)/launch/factory.launch">
  <arg name="routers" value="2"/><arg name="spacing" value="6"/><arg name="hosts" value="2"/>
</include></group></launch>"""
LAYOUT_1 = (1.0, 2.0)
LAYOUT_2 = (7.0, 2.0)  # the places of drones 1 and 2 in two_simulations.yaml
FAILED = 2
PROGRAMS = ("views.order_commands", "views.status", "world.drone_factory_node")


class Site:
    """What a simulation shows of itself."""

    def __init__(self, namespace: str, drones: int) -> None:
        self.namespace, self._drones = namespace, drones
        self._state = MeshState()
        self.now_s = 0.0
        rospy.Subscriber(f"{namespace}/mesh/state", MeshState, self._on_state)
        rospy.Subscriber(f"{namespace}/clock", Clock, self._on_clock, queue_size=1)

    def _on_state(self, state: MeshState) -> None:
        self._state = state

    def _on_clock(self, tick: Clock) -> None:
        self.now_s = tick.clock.to_sec()
        time.sleep(CLOCK_REST_S)

    def wait_until_connected(self) -> None:
        wait_for(f"{self.namespace} connected", 2 * WALL_LIMIT_S, self._is_connected)

    def _is_connected(self) -> bool:
        nodes = self._state.nodes
        return len(nodes) == self._drones and all(node.connected for node in nodes)

    def place(self, drone: int) -> tuple[float, float]:
        answer = call(f"{self.namespace}/Drones/{drone}/gps", RequestGPS)
        return answer.longitude, answer.latitude


def names_of(nodes: str) -> set[str]:
    """Topics and services of nodes whose name begins like this, but for the log's."""
    offers = rosgraph.Master("/rostest").getSystemState()
    found = {
        name for kind in offers for name, users in kind if any(u.startswith(nodes) for u in users)
    }
    return found - {"/rosout", "/rosout_agg"}


class TwoSimulationsTest(unittest.TestCase):
    def test_each_lives_in_its_namespace_with_all_tools_until_its_own_end(self) -> None:
        rospy.init_node("test_two_simulations", argv=["/clock:=/site_a/clock"])
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = Path(folder.name)
        launch = self.folder / "b.launch"
        launch.write_text(SITE_B, encoding="utf-8")
        second = self.launch(str(launch))
        self.a, self.b = Site("/site_a", 4), Site("/site_b", 3)
        for site in (self.a, self.b):
            site.wait_until_connected()

        self.names_are_apart()
        self.times_are_apart()
        self.orders_are_apart()
        self.tools_take_the_namespace()
        recorded_s = self.one_is_recorded()

        second.send_signal(signal.SIGINT)
        second.wait(WALL_LIMIT_S)
        self.assertEqual(names_of("/site_b/"), set())
        call("/site_a/SetToCasus", Casus, 1)
        wait_for("drone 1 at its place", WALL_LIMIT_S, lambda: self.a.place(1) == LAYOUT_1)

        self.the_recording_is_read_and_played_elsewhere(recorded_s)
        self.a_second_start_is_refused()

    def names_are_apart(self) -> None:
        for site in ("/site_a/", "/site_b/"):
            names = names_of(site)
            self.assertIn(f"{site}mesh/state", names)
            self.assertEqual([name for name in names if not name.startswith(site)], [])

    def times_are_apart(self) -> None:
        call("/site_b/DroneFactory/setSpeed", SetSpeed, True, 0.0)
        stood_s, passed_s = self.b.now_s, self.a.now_s
        wait_for("time passes at site a", WALL_LIMIT_S, lambda: self.a.now_s > passed_s + 3.0)
        self.assertLess(self.b.now_s, stood_s + 1.0)
        call("/site_b/DroneFactory/setSpeed", SetSpeed, False, 1.0)

    def orders_are_apart(self) -> None:
        before = self.b.place(1)
        flown = subprocess.run(  # not in a fork, which imported rospy before
            program("fly", "1", "2.0", "2.0", "__ns:=site_a"),
            capture_output=True,
            timeout=WALL_LIMIT_S,
            check=False,
            text=True,
        )
        self.assertEqual(flown.returncode, 0, flown.stderr)
        x, y = self.a.place(1)
        self.assertLess(abs(x - 2.0) + abs(y - 2.0), 0.2)
        self.assertEqual(self.b.place(1), before)
        ordered = run_program("layout", "2", "__ns:=/site_a")
        self.assertEqual(ordered.returncode, 0, ordered.stderr)
        self.assertEqual(self.a.place(2), LAYOUT_2)
        self.assertEqual(self.b.place(2), (6.0, 0.0))

    def tools_take_the_namespace(self) -> None:
        for site, drones in (("site_a", 4), ("site_b", 3)):
            table = run_program("status", f"__ns:={site}")
            self.assertEqual(
                len(re.findall(r"^\d+ +(?:gateway|router)", table.stdout, re.M)), drones
            )
        missing = run_program("status")
        self.assertEqual(missing.returncode, FAILED)
        self.assertIn("no state on /mesh/state", missing.stderr)
        drawn = run_program("snapshot", str(self.folder / "b.png"), "__ns:=site_b")
        self.assertEqual(drawn.returncode, 0, drawn.stderr)
        self.assertTrue(
            receives("/site_a/mesh_console", "/site_a/mesh/state", "/site_a/DroneFactory")
        )

    def one_is_recorded(self) -> float:
        """Of the namespace alone. Returns a simulated time in the recording."""
        recorder = self.launch(
            "drone_mesh", "record.launch", f"bag:={self.folder}/run", "__ns:=site_b"
        )
        wait_for("the recorder listens", WALL_LIMIT_S, self.recorder_listens)
        begun_s = self.b.now_s
        wait_for("some of it is recorded", WALL_LIMIT_S, lambda: self.b.now_s > begun_s + 4.0)
        recorder.send_signal(signal.SIGINT)
        recorder.wait(WALL_LIMIT_S)
        return begun_s

    def the_recording_is_read_and_played_elsewhere(self, recorded_s: float) -> None:
        """From a namespace to another."""
        (bag,) = self.folder.glob("run*.bag")
        with rosbag.Bag(str(bag)) as recorded:
            topics = set(recorded.get_type_and_topic_info().topics)
        self.assertIn("/site_b/Nodes/2/debug", topics)
        self.assertEqual(
            {t for t in topics if not t.startswith("/site_b/")} - {"/rosout_agg"}, set()
        )
        trace = str(self.folder / "trace.csv")
        for tool in (("status", "--bag", str(bag)), ("flight_trace", str(bag), trace)):
            finished = run_program(*tool)
            self.assertEqual(finished.returncode, 0, finished.stderr)
        site = Site("/again", 3)
        player = self.launch(
            "drone_mesh", "replay.launch", f"bag:={bag}", "console:=false", "__ns:=again"
        )
        site.wait_until_connected()
        wait_for("the recorded time", WALL_LIMIT_S, lambda: site.now_s > recorded_s)
        published, _subscribed, _offered = rosgraph.Master("/rostest").getSystemState()
        again = {topic for topic, nodes in published if "/again/mesh_replay" in nodes}
        self.assertEqual([t for t in again - {"/rosout"} if not t.startswith("/again/")], [])
        player.send_signal(signal.SIGINT)
        player.wait(WALL_LIMIT_S)

    def launch(self, *words: str) -> subprocess.Popen[bytes]:
        launched = subprocess.Popen(["roslaunch", *words])
        self.addCleanup(launched.wait, WALL_LIMIT_S)
        self.addCleanup(launched.send_signal, signal.SIGINT)
        return launched

    @staticmethod
    def recorder_listens() -> bool:
        recorder, factory = "/site_b/mesh_recorder", "/site_b/DroneFactory"
        return pid_of(recorder) is not None and receives(recorder, "/site_b/mesh/state", factory)

    def a_second_start_is_refused(self) -> None:
        pid = pid_of("/site_a/DroneFactory")
        for name, node in (("drone_factory", "DroneFactory"), ("drone_manager", "DroneManager")):
            refused = run_program(name, "__ns:=site_a")
            self.assertEqual(refused.returncode, FAILED)
            lines = [line for line in refused.stderr.splitlines() if "pybullet" not in line]
            self.assertEqual(len(lines), 1, refused.stderr)
            self.assertIn(f"{name}: /site_a/{node} already runs on this master", lines[0])
        launched = subprocess.run(
            ["roslaunch", "drone_mesh", "factory.launch", "namespace:=site_a"],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            timeout=WALL_LIMIT_S,
            check=False,
            text=True,
        )
        lines = [line for line in launched.stderr.splitlines() if "already runs" in line]
        self.assertEqual(len(lines), 1, launched.stderr)
        self.assertIn("/site_a/DroneFactory already runs", lines[0])
        self.assertEqual(pid_of("/site_a/DroneFactory"), pid)


if __name__ == "__main__":
    preload(*(f"drone_mesh.ros.{module}" for module in PROGRAMS))
    rostest.rosrun("drone_mesh", "two_simulations", TwoSimulationsTest)
