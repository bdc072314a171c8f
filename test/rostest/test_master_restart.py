#!/usr/bin/env python3
"""The master is killed during a run and restarts empty; all nodes can be looked up again."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import tempfile
import unittest
from pathlib import Path
from typing import Iterator

import psutil
import rosgraph
import rostest
from rostest_support import free_port, program, wait_for

STARTED_WITHIN_S = 60.0
FOUND_WITHIN_S = 30.0
ONLY_2 = "near: [2]"
OLD_FENCE = "of a world that has ended"


class MasterRestartTest(unittest.TestCase):
    def setUp(self) -> None:
        self.port = free_port()
        self.environment = {**os.environ, "ROS_MASTER_URI": f"http://127.0.0.1:{self.port}"}

    @contextlib.contextmanager
    def started(self, *command: str, output: str = os.devnull) -> Iterator[subprocess.Popen[bytes]]:
        with open(output, "wb") as stdout:
            process = subprocess.Popen(
                command,
                env=self.environment,
                stdout=stdout,
                stderr=subprocess.DEVNULL,
                start_new_session=True,
            )
        try:
            yield process
        finally:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGINT)
            try:
                process.wait(timeout=20)
            except subprocess.TimeoutExpired:
                os.killpg(process.pid, signal.SIGKILL)
                process.wait()

    def run_tool(self, *command: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            command,
            env=self.environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            timeout=60,
            check=False,
            text=True,
        )

    def called(self, service: str, *arguments: str) -> str:
        """What `rosservice call` prints."""
        return self.run_tool("rosservice", "call", service, *arguments).stdout

    def all_connected(self) -> bool:
        """Whether `status` works, which needs the state's topic and the simulated time."""
        return self.run_tool(*program("status")).returncode == 0

    def is_found(self, node: str, topic: str, role: int) -> bool:
        """Whether the master knows a publisher (role 0) or subscriber (1) whose name begins so."""
        master = rosgraph.Master("/rostest", self.environment["ROS_MASTER_URI"])
        users = dict(master.getSystemState()[role]).get(topic, ())
        return any(user.startswith(node) for user in users)

    def markers_are_found(self) -> bool:
        """Whether rviz can find a node that publishes them and subscribes to the states."""
        return self.is_found("/mesh_markers", "/mesh/markers", 0) and self.is_found(
            "/mesh_markers", "/mesh/state", 1
        )

    def manager_is_found(self) -> bool:
        return "/DroneManager/setFence" in self.run_tool("rosservice", "list").stdout

    def master_answers(self) -> bool:
        return rosgraph.is_master_online(self.environment["ROS_MASTER_URI"])

    def test_topics_services_and_parameters_are_found_again(self) -> None:
        core = ("roscore", "-p", str(self.port))
        yard = f"fence:={Path(__file__).parent / 'yard.yaml'}"
        fleet = ("roslaunch", "--wait", "drone_mesh", "factory.launch", "routers:=2", yard)
        with contextlib.ExitStack() as stack:
            first = stack.enter_context(self.started(*core))
            wait_for("a master", STARTED_WITHIN_S, self.master_answers)
            self.run_tool("rosparam", "set", "/drone_mesh/fence", OLD_FENCE)
            stack.enter_context(self.started(*program("drone_manager"), "__name:=DroneManager"))
            wait_for("its manager", STARTED_WITHIN_S, self.manager_is_found)
            stack.enter_context(self.started(*fleet, "manager:=false"))
            wait_for("all connected", STARTED_WITHIN_S, self.all_connected)
            stack.enter_context(self.started(*program("mesh_markers")))
            wait_for("the markers", STARTED_WITHIN_S, self.markers_are_found)
            tables = stack.enter_context(tempfile.NamedTemporaryFile("r"))
            watch = program("status", "--watch")
            watcher = stack.enter_context(self.started(*watch, output=tables.name))
            wait_for("a table", STARTED_WITHIN_S, lambda: "connected" in tables.read())
            for process in psutil.Process(first.pid).children(recursive=True):
                process.kill()
            first.kill()
            wait_for("the master's death", FOUND_WITHIN_S, lambda: not self.master_answers())
            stack.enter_context(self.started(*core))
            wait_for("a new master", STARTED_WITHIN_S, self.master_answers)
            wait_for("the state found again", FOUND_WITHIN_S, self.all_connected)
            wait_for("the markers found again", FOUND_WITHIN_S, self.markers_are_found)
            status = ("/mesh_status", "/mesh/state", 1)
            wait_for("the status found again", FOUND_WITHIN_S, lambda: self.is_found(*status))
            self.assertIsNone(watcher.poll(), "status --watch has ended")
            tables.read()
            wait_for("another table", FOUND_WITHIN_S, lambda: "connected" in tables.read())
            simulated = self.run_tool("rosparam", "get", "/use_sim_time")
            self.assertEqual(simulated.stdout.strip(), "true")
            wait_for("the manager found again", FOUND_WITHIN_S, self.manager_is_found)
            self.assertIn("yard", self.run_tool("rosparam", "get", "/drone_mesh/fence").stdout)
            # Each process registers its services again at a moment of its own.
            order = ("/DroneManager/requestDroneMovement", "2", "3", "3", "0")
            wait_for("an order taken", FOUND_WITHIN_S, lambda: "status: 1" in self.called(*order))
            off = ("/Nodes/1/powerSwitch", "false")
            wait_for("1 switched off", FOUND_WITHIN_S, lambda: "ERROR" not in self.called(*off))
            asker = ("/SignalSimulator/othersinRange", "0")
            wait_for("2 alone in range", FOUND_WITHIN_S, lambda: ONLY_2 in self.called(*asker))


if __name__ == "__main__":
    rostest.rosrun("drone_mesh", "master_restart", MasterRestartTest)
