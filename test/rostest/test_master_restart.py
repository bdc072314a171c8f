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
import rospy
import rostest
from rostest_support import free_port, preload, program, run_program, wait_for

from drone_mesh.srv import (
    AreaScan,
    AreaScanResponse,
    PowerSwitch,
    RequestDroneFlight,
    RequestDroneFlightResponse,
)

STARTED_WITHIN_S = 60.0
FOUND_WITHIN_S = 30.0
OLD_FENCE = "of a world that has ended"


class MasterRestartTest(unittest.TestCase):
    def setUp(self) -> None:
        self.port = free_port()
        # Also that of this process, which asks the master anew at each call.
        os.environ["ROS_MASTER_URI"] = f"http://127.0.0.1:{self.port}"
        self.master = rosgraph.Master("/rostest")

    @contextlib.contextmanager
    def started(self, *command: str, output: str = os.devnull) -> Iterator[subprocess.Popen[bytes]]:
        with open(output, "wb") as stdout:
            process = subprocess.Popen(
                command,
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

    def answers(self, service: str, kind: type, *arguments: object) -> object:
        """The service's answer; None as long as it is not found, or refuses."""
        try:
            return rospy.ServiceProxy(service, kind)(*arguments)
        except rospy.ServiceException:
            return None

    def all_connected(self) -> bool:
        """Whether `status` works, which needs the state's topic and the simulated time."""
        return run_program("status").returncode == 0

    def is_found(self, node: str, topic: str, role: int) -> bool:
        """Whether the master knows a publisher (role 0) or subscriber (1) whose name begins so."""
        users = dict(self.master.getSystemState()[role]).get(topic, ())
        return any(user.startswith(node) for user in users)

    def markers_are_found(self) -> bool:
        """Whether rviz can find a node that publishes them and subscribes to the states."""
        return self.is_found("/mesh_markers", "/mesh/markers", 0) and self.is_found(
            "/mesh_markers", "/mesh/state", 1
        )

    def manager_is_found(self) -> bool:
        return "/DroneManager/setFence" in dict(self.master.getSystemState()[2])

    def test_topics_services_and_parameters_are_found_again(self) -> None:
        core = ("roscore", "-p", str(self.port))
        yard = f"fence:={Path(__file__).parent / 'yard.yaml'}"
        fleet = ("roslaunch", "--wait", "drone_mesh", "factory.launch", "routers:=2", yard)
        with contextlib.ExitStack() as stack:
            first = stack.enter_context(self.started(*core))
            wait_for("a master", STARTED_WITHIN_S, rosgraph.is_master_online)
            self.master.setParam("/drone_mesh/fence", OLD_FENCE)
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
            wait_for("the master's death", FOUND_WITHIN_S, lambda: not rosgraph.is_master_online())
            stack.enter_context(self.started(*core))
            wait_for("a new master", STARTED_WITHIN_S, rosgraph.is_master_online)
            wait_for("the state found again", FOUND_WITHIN_S, self.all_connected)
            wait_for("the markers found again", FOUND_WITHIN_S, self.markers_are_found)
            status = ("/mesh_status", "/mesh/state", 1)
            wait_for("the status found again", FOUND_WITHIN_S, lambda: self.is_found(*status))
            self.assertIsNone(watcher.poll(), "status --watch has ended")
            tables.read()
            wait_for("another table", FOUND_WITHIN_S, lambda: "connected" in tables.read())
            self.assertIs(self.master.getParam("/use_sim_time"), True)
            wait_for("the manager found again", FOUND_WITHIN_S, self.manager_is_found)
            self.assertIn("yard", self.master.getParam("/drone_mesh/fence"))
            # Each process registers its services again at a moment of its own.
            order = ("/DroneManager/requestDroneMovement", RequestDroneFlight, 2, 3.0, 3.0, 0)
            taken = RequestDroneFlightResponse(1)
            wait_for("an order taken", FOUND_WITHIN_S, lambda: self.answers(*order) == taken)
            off = ("/Nodes/1/powerSwitch", PowerSwitch, False)
            wait_for("1 switched off", FOUND_WITHIN_S, lambda: self.answers(*off) is not None)
            asker = ("/SignalSimulator/othersinRange", AreaScan, 0)
            only_2 = AreaScanResponse(bytes([2]))
            wait_for("2 alone in range", FOUND_WITHIN_S, lambda: self.answers(*asker) == only_2)


if __name__ == "__main__":
    preload("drone_mesh.ros.views.status")
    rostest.rosrun("drone_mesh", "master_restart", MasterRestartTest)
