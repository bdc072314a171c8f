#!/usr/bin/env python3
"""The package, installed: a new terminal needs its setup.bash and nothing else."""

from __future__ import annotations

import os
import signal
import subprocess
import tempfile
import unittest
from pathlib import Path

import rostest
from rostest_support import WALL_LIMIT_S, free_port, wait_for

BUILD = Path(__file__).resolve().parents[2] / "build"


class InstallSpaceTest(unittest.TestCase):
    def test_a_simulation_starts_from_it_in_a_clean_environment(self) -> None:
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        # Not into the checkout: rospack would find the package twice.
        subprocess.run(
            ["cmake", "--build", str(BUILD), "--target", "install"],
            env={**os.environ, "DESTDIR": folder.name},
            stdout=subprocess.DEVNULL,
            timeout=4 * WALL_LIMIT_S,
            check=True,
        )
        (self.setup,) = Path(folder.name).rglob("setup.bash")
        self.environment = {
            "HOME": os.environ["HOME"],
            "PATH": "/usr/bin:/bin",
            "ROS_HOSTNAME": "localhost",
            "ROS_MASTER_URI": f"http://localhost:{free_port()}",
        }
        found = self.output("rospack find drone_mesh; rosrun drone_mesh lab --help")
        self.assertIn(str(self.setup.parent / "share" / "drone_mesh"), found)
        self.assertIn("usage: rosrun drone_mesh lab", found)
        launch = self.start("roslaunch drone_mesh factory.launch routers:=2 spacing:=6")
        try:
            connected = "2 of 2 routers connected"
            wait_for(
                connected,
                2 * WALL_LIMIT_S,
                lambda: connected in self.output("rosrun drone_mesh status"),
            )
        finally:
            os.killpg(launch.pid, signal.SIGINT)
            launch.wait(WALL_LIMIT_S)

    def start(self, command: str, stdout: int | None = None) -> subprocess.Popen[str]:
        return subprocess.Popen(
            ["bash", "-c", f". {self.setup} && {command}"],
            env=self.environment,
            stdout=stdout,
            start_new_session=True,
            text=True,
        )

    def output(self, command: str) -> str:
        return self.start(command, subprocess.PIPE).communicate(timeout=WALL_LIMIT_S)[0]


if __name__ == "__main__":
    rostest.rosrun("drone_mesh", "install_space", InstallSpaceTest)
