#!/usr/bin/env python3
"""The nodes are spread over two processes, which stay in step; one is killed and comes back.

On an overloaded machine the mesh is slower, but not different.
"""

from __future__ import annotations

import collections
import contextlib
import os
import signal
import subprocess
import sys
import time
import unittest
from typing import Iterator

import rospy
import rostest
from rosgraph_msgs.msg import Clock
from rostest_support import (
    WALL_LIMIT_S,
    LogWatch,
    MeshWatch,
    call,
    in_order,
    pid_of,
    program,
    wait_for,
)

from drone_mesh.msg import HostProgress, MeshEvent, MeshState
from drone_mesh.srv import AddDrone, RemoveDrone, SetSpeed

NOTHING_DONE = rospy.Time()
REPEAT_S = 0.2  # wall
DRONES = 24
START_S = 100.0  # wall
SIMULATED_S = 3.0  # each node checks its connection at least once
WITHIN_S = 60.0  # wall; a twentieth of full speed
STANDS_FOR_S = 3.0  # wall; longer than the world waits for a host that is silent


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


class ProgressTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls) -> None:
        cls.mesh = MeshWatch(4)
        cls.now_s = 0.0
        cls.said: collections.Counter[str] = collections.Counter()
        rospy.Subscriber("/clock", Clock, cls._tick)
        rospy.Subscriber(
            "/mesh/progress", HostProgress, lambda heard: cls.said.update([heard.host])
        )
        cls.log = LogWatch()
        cls.mesh.wait("all connected", 60, cls.mesh.connected)

    @classmethod
    def _tick(cls, clock: Clock) -> None:
        cls.now_s = clock.clock.to_sec()

    def test_each_host_goes_on_telling_while_time_stands_still(self) -> None:
        self.addCleanup(self._go_on)
        self.assertTrue(call("/DroneFactory/setSpeed", SetSpeed, True, 0.0).success)
        self._wait_until_time_stands()
        before = self.said.copy()
        hosts = ("/mesh_host_1", "/mesh_host_2")
        wait_for(
            "two reports of progress from each host",
            WALL_LIMIT_S,
            lambda: all(self.said[host] - before[host] >= 2 for host in hosts),
        )
        self._go_on()
        self.mesh.pass_time(1.0)

    def test_a_node_that_is_not_a_host_cannot_stop_time(self) -> None:
        stranger = rospy.Publisher("/mesh/progress", HostProgress, queue_size=10)
        wait_for("the world listens", WALL_LIMIT_S, lambda: stranger.get_num_connections() >= 2)
        begun_s, until_s = self.now_s, time.monotonic() + STANDS_FOR_S
        while time.monotonic() < until_s or not self.log.lines("progress ignored"):
            stranger.publish(HostProgress("/mesh_host_1", NOTHING_DONE, 0))
            time.sleep(REPEAT_S)
            self.assertLess(time.monotonic(), until_s + WALL_LIMIT_S, "nothing was logged")
        self.assertIn(rospy.get_name(), self.log.lines("progress ignored")[0])
        wait_for("time to go on", WALL_LIMIT_S, lambda: self.now_s > begun_s + 1.0)

    def declare_as_host(self) -> None:
        name = f"/drone_mesh/hosts{rospy.get_name()}"
        rospy.set_param(name, [200, 201])
        self.addCleanup(rospy.delete_param, name)

    def test_the_world_waits_for_a_host_that_is_behind_but_not_for_a_silent_one(self) -> None:
        self.declare_as_host()
        slow = rospy.Publisher("/mesh/progress", HostProgress, queue_size=10)
        wait_for("the world listens", WALL_LIMIT_S, lambda: slow.get_num_connections() >= 2)
        late = HostProgress("/slow_host", NOTHING_DONE, 0)
        self._wait_until_time_stands(lambda: slow.publish(late))
        stands_at_s, until_s = self.now_s, time.monotonic() + STANDS_FOR_S
        while time.monotonic() < until_s:
            slow.publish(late)
            time.sleep(REPEAT_S)
            self.assertEqual(self.now_s, stands_at_s)
        wait_for("a line", WALL_LIMIT_S, lambda: self.log.lines("time stands still"))
        self.assertIn(
            f"waiting for host {rospy.get_name()}", self.log.lines("time stands still")[0]
        )
        wait_for("time goes on", WALL_LIMIT_S, lambda: self.now_s > stands_at_s + 1.0)

    def test_what_a_host_said_too_late_takes_nothing_back(self) -> None:
        self.declare_as_host()
        host = rospy.Publisher("/mesh/progress", HostProgress, queue_size=10)
        wait_for("the world listens", WALL_LIMIT_S, lambda: host.get_num_connections() >= 2)
        begun_s = self.now_s
        ahead = rospy.Time.from_sec(begun_s + 1000.0)
        host.publish(HostProgress("/hasty_host", ahead, 0))

        def time_went_on() -> bool:
            host.publish(HostProgress("/hasty_host", NOTHING_DONE, 0))
            time.sleep(REPEAT_S)
            return self.now_s > begun_s + 2.0

        wait_for("time goes on all the same", WALL_LIMIT_S, time_went_on)

    def _go_on(self) -> None:
        self.assertTrue(call("/DroneFactory/setSpeed", SetSpeed, False, 0.0).success)

    def _wait_until_time_stands(self, meanwhile=lambda: None) -> None:
        seen_s, looks = -1.0, 0

        def stands() -> bool:
            nonlocal seen_s, looks
            meanwhile()
            before_s, seen_s = seen_s, self.now_s
            time.sleep(REPEAT_S)
            looks = looks + 1 if before_s == seen_s == self.now_s else 0
            return looks >= 5  # a busy machine makes ticks late

        wait_for("time stands still", WALL_LIMIT_S, stands)


class HostsTest(unittest.TestCase):
    def test_only_the_drones_of_a_killed_host_are_lost_and_they_rejoin(self) -> None:
        log = LogWatch()
        mesh = MeshWatch(DRONES + 2)  # ids 0..11 and 12..23 in one host each; two are added
        mesh.wait("all connected", 60, lambda: mesh.connected(range(DRONES)))
        for host, latitude in ((1, 0.0), (2, 6.0)):
            added = call("/DroneFactory/addDrone", AddDrone, 255, False, latitude, 30.0)
            self.assertIn(f"/mesh_host_{host} runs its node", added.message)
        mesh.wait("the new ones connected", 60, mesh.connected)

        refused = subprocess.run(
            program("mesh_host", "__name:=second", "_first:=12", "_last:=13"),
            stderr=subprocess.PIPE,
            timeout=WALL_LIMIT_S,
            check=False,
            text=True,
        )
        self.assertNotEqual(refused.returncode, 0)
        self.assertIn("node 12 is already hosted by another process", refused.stderr)
        self.assertNotIn("Traceback", refused.stderr)

        # A restarted node counts from 0: it must have sent enough to be recognised.
        mesh.wait("12 has sent 40 messages", 90, lambda: mesh.info(12).totalMessages >= 40)
        old_pid = pid_of("/mesh_host_2")
        sent = mesh.info(12).totalMessages
        os.kill(old_pid, signal.SIGKILL)
        mesh.wait("the others stay connected", 1, lambda: mesh.connected(range(12)))
        wait_for("respawn", WALL_LIMIT_S, lambda: pid_of("/mesh_host_2") not in (None, old_pid))
        mesh.forget(*range(12, DRONES), 25)  # what they reported before their death
        mesh.wait("12 restarted", 240, lambda: 12 in mesh.hops())
        self.assertLess(mesh.info(12).totalMessages, sent, "it still counts as before")
        mesh.wait("the nodes of host 2 connected again", 240, mesh.connected)
        removed = call("/DroneFactory/removeDrone", RemoveDrone, 25)  # in the restarted host
        self.assertTrue(removed.success, removed.message)
        with self.assertRaises(rospy.ROSException):
            rospy.wait_for_service("/Nodes/25/powerSwitch", timeout=0.1)
        self.assertEqual(log.failures(), [])


def suite() -> unittest.TestSuite:
    return in_order(OverloadTest, HostsTest, ProgressTest)


if __name__ == "__main__":
    rospy.init_node("test_hosts")
    rostest.rosrun("drone_mesh", "hosts", "__main__.suite")
