#!/usr/bin/env python3
"""Ctrl-C in the terminal of roslaunch: everything ends by itself, without a traceback.

roslaunch waits for 15 s and then sends SIGTERM ("escalating"). The test prints how long the end
takes: about 4 s on an idle machine, most of it in roslaunch.
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

import rosgraph
import rostest
from rostest_support import free_port, wait_for

NODES = ("wireless_signal_simulator", "drone_manager", "drone_factory", "fly_actions")


ASKS = """
import rospy
from drone_mesh.ros.graph.command_line import start_node

start_node("", "asks")
print("asks", flush=True)
while not rospy.is_shutdown():
    rospy.get_param("/run_id")
"""


def processes_of(port: int) -> dict[int, str]:
    """Command lines of our nodes that talk to the master on this port, by process id."""
    found = {}
    for process in Path("/proc").glob("[0-9]*"):
        try:
            command = (process / "cmdline").read_bytes().replace(b"\0", b" ").decode()
            environment = (process / "environ").read_bytes().decode("utf-8", "replace")
        except OSError:
            continue  # it has ended meanwhile, or is not ours
        if f":{port}" in environment and any(node in command for node in NODES):
            found[int(process.name)] = command
    return found


class CtrlCTest(unittest.TestCase):
    def run_and_interrupt(
        self, ready: tuple[str, ...], *arguments: str, hangs: str = "", last_line: str = ""
    ) -> None:
        """`hangs`: a node of others, which hangs until `last_line` is in the output."""
        port = free_port()
        environment = {**os.environ, "ROS_MASTER_URI": f"http://127.0.0.1:{port}"}
        with tempfile.TemporaryFile("w+") as output, contextlib.ExitStack() as others:

            def said() -> str:
                output.seek(0)
                return output.read()

            launch = subprocess.Popen(
                ["roslaunch", "-p", str(port), "drone_mesh", "factory.launch", *arguments],
                stdout=output,
                stderr=subprocess.STDOUT,
                env=environment,
                start_new_session=True,
            )
            try:
                if hangs:
                    wait_for("a node", 60, lambda: processes_of(port))
                    command = [sys.executable, str(Path(__file__).with_name(hangs))]
                    other = others.enter_context(subprocess.Popen(command, env=environment))
                    others.callback(other.kill)
                for line in ready:
                    wait_for(f"'{line}' in the output", 60, lambda line=line: line in said())
                if hangs:
                    other.send_signal(signal.SIGSTOP)
                    wait_for(f"'{last_line}' in the output", 60, lambda: last_line in said())
                begun_s = time.monotonic()
                os.killpg(launch.pid, signal.SIGINT)  # as a terminal does: to all processes
                launch.wait(timeout=30)
                took_s = time.monotonic() - begun_s
            finally:
                if launch.poll() is None:
                    os.killpg(launch.pid, signal.SIGKILL)
            self.assertNotIn("Traceback", said())
            self.assertNotIn("escalating", said())
            print(f"ended after {took_s:.1f} s")
            self.assertEqual(processes_of(port), {})

    def test_while_the_mesh_runs(self) -> None:
        ready = ("started 9 nodes", "offering the flights of 9 drones as actions")
        self.run_and_interrupt(ready, "routers:=8", "actions:=true")

    def test_while_the_world_waits_for_its_next_step(self) -> None:
        self.run_and_interrupt(("started 2 nodes",), "routers:=1", "real_time_factor:=0.001")

    def test_while_the_nodes_are_being_started(self) -> None:
        self.run_and_interrupt(("fleet: gateways 1, routers 30",), "routers:=30")

    def test_while_emulated_radios_are_in_each_others_way(self) -> None:
        self.run_and_interrupt(("started 6 nodes",), "routers:=5", "radio:=nrf24")

    def test_while_a_simulator_of_others_hangs(self) -> None:
        self.run_and_interrupt(
            ("connected to the simulator", "started 3 nodes"),
            "routers:=2",
            "simulator:=false",
            hangs="simple_simulator.py",
            last_line="lost the simulator",
        )

    def test_while_the_master_hangs(self) -> None:
        """roslaunch would wait for it as well, so the nodes are told themselves."""
        port = free_port()
        uri = f"http://127.0.0.1:{port}"
        launch = subprocess.Popen(
            [
                "roslaunch",
                "-p",
                str(port),
                "drone_mesh",
                "factory.launch",
                "routers:=5",
                "actions:=true",
            ],
            env={**os.environ, "ROS_MASTER_URI": uri},
            stdout=subprocess.PIPE,
            text=True,
        )
        master = 0
        try:
            assert launch.stdout is not None
            wanted = {"started 6 nodes", "offering the flights"}
            while wanted:
                line = launch.stdout.readline()
                self.assertTrue(line, f"it ended without '{wanted}'")
                wanted = {part for part in wanted if part not in line}
            nodes = processes_of(port)
            self.assertEqual(len(nodes), len(NODES), nodes)
            master = rosgraph.Master("/test_ctrl_c", uri).getPid()
            os.kill(master, signal.SIGSTOP)
            begun_s = time.monotonic()
            for pid in nodes:
                os.kill(pid, signal.SIGINT)
            wait_for("they end", 15, lambda: not processes_of(port).keys() & nodes.keys())
            print(f"ended after {time.monotonic() - begun_s:.1f} s")
        finally:
            if master:
                os.kill(master, signal.SIGCONT)
            launch.send_signal(signal.SIGINT)
            launch.communicate(timeout=60)

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
