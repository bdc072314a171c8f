#!/usr/bin/env python3
"""A checkout in a path with a space is built and runs."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import tempfile
import unittest
from pathlib import Path

import rostest
from rostest_support import WALL_LIMIT_S, free_port, wait_for

CHECKOUT = Path(__file__).resolve().parents[2]
LEFT_OUT = (".*", "build", "logs", "__pycache__")


class PathWithSpaceTest(unittest.TestCase):
    def test_run_builds_and_starts_a_simulation_there(self) -> None:
        folder = tempfile.TemporaryDirectory(prefix="with space ")
        self.addCleanup(folder.cleanup)
        root = Path(folder.name) / "drone mesh"
        shutil.copytree(CHECKOUT, root, ignore=shutil.ignore_patterns(*LEFT_OUT))
        (root / ".venv").symlink_to((CHECKOUT / ".venv").resolve())
        environment = {
            "HOME": os.environ["HOME"],
            "PATH": "/usr/bin:/bin",
            "ROS_HOSTNAME": "localhost",
            "ROS_MASTER_URI": f"http://localhost:{free_port()}",
            "ROS_LANG_DISABLE": "gencpp:geneus:genlisp:gennodejs",  # Python is all that runs
        }

        def status() -> str:
            command = ". scripts/env.bash && rosrun drone_mesh status"
            return subprocess.run(
                ["bash", "-c", command],
                cwd=root,
                env=environment,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
                timeout=WALL_LIMIT_S,
                check=False,
                text=True,
            ).stdout

        run = subprocess.Popen(
            ["scripts/run", "routers:=2", "spacing:=6"],
            cwd=root,
            env=environment,
            start_new_session=True,
        )
        try:
            wait_for(
                "2 of 2 routers connected",
                4 * WALL_LIMIT_S,
                lambda: "2 of 2 routers connected" in status() or run.poll() is not None,
            )
            self.assertIsNone(run.poll(), "it ended")
        finally:
            if run.poll() is None:
                os.killpg(run.pid, signal.SIGINT)
            run.wait(WALL_LIMIT_S)


if __name__ == "__main__":
    rostest.rosrun("drone_mesh", "path_with_space", PathWithSpaceTest)
