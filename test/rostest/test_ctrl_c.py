#!/usr/bin/env python3
"""Ctrl-C in the terminal of roslaunch: everything ends by itself, without a traceback.

roslaunch waits for 15 s and then sends SIGTERM ("escalating"). The test prints how long the end
takes: about 4 s on an idle machine, most of it in roslaunch.
"""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import tempfile
import time
import unittest
from pathlib import Path

import rostest
from rostest_support import free_port, wait_for

# roslaunch 1.15.9 (Debian 11) prints this about itself, at its very end, on Python 3.9.
ROSLAUNCHS_OWN = re.compile(
    r"exception in shutdown_process_monitor: 'ProcessMonitor' object has no attribute 'isAlive'\n"
    r"Traceback [^\n]*\n( [^\n]*\n)+AttributeError: [^\n]*'isAlive'\n"
)
NODES = ("wireless_signal_simulator", "drone_manager", "drone_factory", "fly_actions")


ASKS = """
import rospy
from drone_mesh.ros.graph.command_line import start_node

start_node("", "asks")
print("asks", flush=True)
while not rospy.is_shutdown():
    rospy.get_param("/run_id")
"""


def processes_of(port: int) -> list[str]:
    """Command lines of our nodes that talk to the master on this port."""
    found = []
    for process in Path("/proc").glob("[0-9]*"):
        try:
            command = (process / "cmdline").read_bytes().replace(b"\0", b" ").decode()
            environment = (process / "environ").read_bytes().decode("utf-8", "replace")
        except OSError:
            continue  # it has ended meanwhile, or is not ours
        if f":{port}" in environment and any(node in command for node in NODES):
            found.append(command)
    return found


class CtrlCTest(unittest.TestCase):
    def run_and_interrupt(self, ready: tuple[str, ...], *arguments: str) -> None:
        port = free_port()
        environment = {**os.environ, "ROS_MASTER_URI": f"http://127.0.0.1:{port}"}
        with tempfile.TemporaryFile("w+") as output:

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
                for line in ready:
                    wait_for(f"'{line}' in the output", 60, lambda line=line: line in said())
                begun_s = time.monotonic()
                os.killpg(launch.pid, signal.SIGINT)  # as a terminal does: to all processes
                launch.wait(timeout=30)
                took_s = time.monotonic() - begun_s
            finally:
                if launch.poll() is None:
                    os.killpg(launch.pid, signal.SIGKILL)
            self.assertNotIn("Traceback", ROSLAUNCHS_OWN.sub("", said()))
            self.assertNotIn("escalating", said())
            print(f"ended after {took_s:.1f} s")
            self.assertEqual(processes_of(port), [])

    def test_while_the_mesh_runs(self) -> None:
        ready = ("started 31 nodes", "offering the flights of 31 drones as actions")
        self.run_and_interrupt(ready, "routers:=30", "actions:=true")

    def test_while_the_world_waits_for_its_next_step(self) -> None:
        self.run_and_interrupt(("started 2 nodes",), "routers:=1", "real_time_factor:=0.001")

    def test_while_the_nodes_are_being_started(self) -> None:
        self.run_and_interrupt(("fleet: gateways 1, routers 30",), "routers:=30")

    def test_while_emulated_radios_are_in_each_others_way(self) -> None:
        self.run_and_interrupt(("started 18 nodes",), "radio:=nrf24")

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
