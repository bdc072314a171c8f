#!/usr/bin/env python3
"""A checkout in a path with a space is built and runs, and so does the installed package."""

from __future__ import annotations

import contextlib
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import unittest
from pathlib import Path
from xmlrpc.client import ServerProxy

import rostest
from rostest_support import WALL_LIMIT_S, free_port, wait_for

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from fenced_blocks import blocks  # noqa: E402

CHECKOUT = Path(__file__).resolve().parents[2]
LEFT_OUT = (".*", "build", "logs")
CONNECTED = "2 of 2 routers connected"
SOON_CONNECTED = "routers:=2 spacing:=6 real_time_factor:=3"
ASK_AGAIN_AFTER_S = 0.5
LOOK_AGAIN_AFTER_S = 3.0  # each look costs seconds of processor time


class InstallationsTest(unittest.TestCase):
    def setUp(self) -> None:
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = Path(folder.name)
        self.environment = {
            "HOME": os.environ["HOME"],
            "PATH": "/usr/bin:/bin",
            "ROS_HOSTNAME": "localhost",
            "ROS_MASTER_URI": f"http://localhost:{free_port()}",
        }

    def start(self, command: str, cwd: Path, stdout: int | None = None) -> subprocess.Popen[str]:
        return subprocess.Popen(
            ["bash", "-c", command],
            cwd=cwd,
            env=self.environment,
            stdout=stdout,
            start_new_session=True,
            text=True,
        )

    def output(self, command: str, cwd: Path) -> str:
        return self.start(command, cwd, subprocess.PIPE).communicate(timeout=WALL_LIMIT_S)[0]

    def shows_its_state(self) -> bool:
        with contextlib.suppress(OSError):
            master = ServerProxy(self.environment["ROS_MASTER_URI"])
            _code, _text, (publishers, *_others) = master.getSystemState("/installations")
            return "/mesh/state" in dict(publishers)
        return False

    def run_until_connected(self, simulation: str, setup: str, cwd: Path, also: str = "") -> None:
        """Start a simulation, and look at it in another terminal, until it shows `also` too."""
        run = self.start(f"{simulation} {SOON_CONNECTED}", cwd)
        shown = ""

        def begun() -> bool:
            time.sleep(ASK_AGAIN_AFTER_S)
            return self.shows_its_state() or run.poll() is not None

        def connected() -> bool:
            nonlocal shown
            time.sleep(LOOK_AGAIN_AFTER_S)
            shown = self.output(f"{setup} && rosrun drone_mesh status", cwd)
            return CONNECTED in shown or run.poll() is not None

        try:
            wait_for("a state of the mesh", 4 * WALL_LIMIT_S, begun)
            wait_for(CONNECTED, 4 * WALL_LIMIT_S, connected)
            self.assertIsNone(run.poll(), "it ended")
            self.assertIn(also, shown)
        finally:
            if run.poll() is None:
                os.killpg(run.pid, signal.SIGINT)
            run.wait(WALL_LIMIT_S)

    def test_run_builds_and_starts_a_simulation_in_a_path_with_a_space(self) -> None:
        root = self.folder / "with space" / "drone mesh"
        shutil.copytree(CHECKOUT, root, ignore=shutil.ignore_patterns(*LEFT_OUT))
        (root / ".venv").symlink_to((CHECKOUT / ".venv").resolve())
        (documented,) = (block for block in blocks("bash") if block.test == "clone")
        (command,) = documented.commands()
        chosen = command.rpartition(":")[2]  # as in repair:=own_repair:LowestId
        self.run_until_connected(command, ". scripts/env.bash", root, chosen)

    def test_the_installed_package_needs_its_setup_and_nothing_else(self) -> None:
        # Not into the checkout: rospack would find the package twice.
        subprocess.run(
            ["cmake", "--install", str(CHECKOUT / "build")],
            env={**os.environ, "DESTDIR": str(self.folder)},
            stdout=subprocess.DEVNULL,
            timeout=4 * WALL_LIMIT_S,
            check=True,
        )
        (setup,) = self.folder.rglob("setup.bash")
        sourced = f". {setup}"
        shown = self.output(
            f"{sourced} && rospack find drone_mesh && rosrun drone_mesh lab --help",
            self.folder,
        )
        self.assertIn(str(setup.parent / "share" / "drone_mesh"), shown)
        self.assertIn("usage: rosrun drone_mesh lab", shown)
        self.run_until_connected(
            f"{sourced} && exec roslaunch drone_mesh factory.launch", sourced, self.folder
        )


if __name__ == "__main__":
    rostest.rosrun("drone_mesh", "installations", InstallationsTest)
