#!/usr/bin/env python3
"""Ctrl-C in the terminal of roslaunch: everything ends by itself, without a traceback.

roslaunch waits for 15 s and then sends SIGTERM ("escalating"). Where what a node does while it is
interrupted matters, the nodes are started without it. The tests print how long the end takes.
"""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import tempfile
import time
import unittest
from pathlib import Path
from typing import Sequence

import rosgraph
import rostest
from rostest_support import free_port, program, wait_for

NODES = ("wireless_signal_simulator", "drone_manager", "fly_actions")
PATIENCE_S = 15.0  # of roslaunch


ASKS = """
import rospy
from drone_mesh.ros.graph.command_line import start_node

start_node("", "asks")
print("asks", flush=True)
while not rospy.is_shutdown():
    rospy.get_param("/run_id")
"""


def processes_of(port: str) -> dict[int, str]:
    """Command lines of our nodes that talk to the master on this port, by process id."""
    found = {}
    for process in Path("/proc").glob("[0-9]*"):
        try:
            command = (process / "cmdline").read_bytes().replace(b"\0", b" ").decode()
            environment = (process / "environ").read_bytes().decode("utf-8", "replace")
        except OSError:
            continue  # it has ended meanwhile, or is not ours
        if f":{port}" in environment and any(node in command for node in (*NODES, "drone_factory")):
            found[int(process.name)] = command
    return found


class CtrlCTest(unittest.TestCase):
    def setUp(self) -> None:
        self.environment = dict(os.environ)
        with contextlib.ExitStack() as opened:
            self.output = opened.enter_context(tempfile.TemporaryFile("w+"))
            self.addCleanup(opened.pop_all().close)
        self.nodes: list[subprocess.Popen[bytes]] = []

    def on_own_master(self) -> str:
        """Let what starts from now on use another master; returns its port."""
        port = str(free_port())
        self.environment["ROS_MASTER_URI"] = f"http://127.0.0.1:{port}"
        return port

    def start(self, *command: str) -> subprocess.Popen[bytes]:
        process = subprocess.Popen(
            command,
            stdout=self.output,
            stderr=subprocess.STDOUT,
            env=self.environment,
            start_new_session=True,
        )
        self.addCleanup(process.wait)
        self.addCleanup(process.kill)
        return process

    def start_world(self, *parameters: str, beside: Sequence[str] = ()) -> None:
        """Start the world and other nodes as roslaunch does."""
        master = rosgraph.Master("/test_ctrl_c", self.environment["ROS_MASTER_URI"])
        master.setParam("/use_sim_time", True)
        self.addCleanup(master.deleteParam, "/DroneFactory")  # they remain for the next one
        self.nodes = [self.start(*program(name)) for name in beside]
        self.nodes.append(self.start(*program("drone_factory", *parameters)))

    def said(self) -> str:
        self.output.seek(0)
        return self.output.read()

    def wait_for_lines(self, *lines: str) -> None:
        for line in lines:
            wait_for(f"'{line}' in the output", 60, lambda line=line: line in self.said())

    def interrupt_nodes(self) -> None:
        """As roslaunch does, all of them at once; they end before it would send SIGTERM."""
        begun_s = time.monotonic()
        for node in self.nodes:
            node.send_signal(signal.SIGINT)
        for node in self.nodes:
            node.wait(timeout=PATIENCE_S)
        print(f"ended after {time.monotonic() - begun_s:.1f} s")

    def test_of_roslaunch_while_the_mesh_runs(self) -> None:
        port = self.on_own_master()
        words = ("routers:=2", "actions:=true")
        launch = self.start("roslaunch", "-p", port, "drone_mesh", "factory.launch", *words)
        self.wait_for_lines("started 3 nodes", "offering the flights of 3 drones as actions")
        begun_s = time.monotonic()
        os.killpg(launch.pid, signal.SIGINT)  # as a terminal does: to all processes
        launch.wait(timeout=30)
        print(f"ended after {time.monotonic() - begun_s:.1f} s")
        self.assertNotIn("Traceback", self.said())
        self.assertNotIn("escalating", self.said())
        self.assertEqual(processes_of(port), {})

    def test_while_the_world_waits_for_its_next_step(self) -> None:
        slowest = ("_routers:=1", "_real_time_factor:=0.001")
        self.start_world(*slowest, beside=["wireless_signal_simulator"])
        self.wait_for_lines("started 2 nodes")
        self.interrupt_nodes()
        self.assertNotIn("Traceback", self.said())

    def test_while_the_nodes_are_being_started(self) -> None:
        self.start_world("_routers:=30", beside=["wireless_signal_simulator"])
        self.wait_for_lines("fleet: gateways 1, routers 30")
        self.interrupt_nodes()
        self.assertNotIn("Traceback", self.said())

    def test_while_emulated_radios_are_in_each_others_way(self) -> None:
        self.start_world("_routers:=5", "_radio:=nrf24")
        self.wait_for_lines("started 6 nodes")
        self.interrupt_nodes()
        self.assertNotIn("Traceback", self.said())

    def test_while_a_simulator_of_others_hangs(self) -> None:
        others = Path(__file__).with_name("simple_simulator.py")
        simulator = self.start(sys.executable, str(others))
        self.start_world("_routers:=2")
        self.wait_for_lines("connected to the simulator", "started 3 nodes")
        simulator.send_signal(signal.SIGSTOP)
        self.wait_for_lines("lost the simulator")
        self.interrupt_nodes()
        self.assertNotIn("Traceback", self.said())

    def test_while_the_master_hangs(self) -> None:
        port = self.on_own_master()
        master = self.start("rosmaster", "--core", "-p", port)
        uri = self.environment["ROS_MASTER_URI"]
        wait_for("a master", 60, lambda: rosgraph.is_master_online(uri))
        self.start_world("_routers:=2", beside=NODES)
        self.wait_for_lines("started 3 nodes", "offering the flights")
        master.send_signal(signal.SIGSTOP)
        self.addCleanup(master.send_signal, signal.SIGCONT)  # to take what is deleted after it
        self.interrupt_nodes()

    def test_while_a_node_asks_the_master(self) -> None:
        """rospy's own handler would wait for the call that it interrupts, for ever."""
        with subprocess.Popen(
            [sys.executable, "-c", ASKS], stdout=subprocess.PIPE, text=True
        ) as asks:
            try:
                assert asks.stdout is not None
                self.assertEqual(asks.stdout.readline(), "asks\n")
                asks.send_signal(signal.SIGINT)
                self.assertEqual(asks.wait(timeout=15), 0)
            finally:
                asks.kill()


if __name__ == "__main__":
    rostest.rosrun("drone_mesh", "ctrl_c", CtrlCTest)
