"""README's commands for a second terminal, exactly as written and in that order."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import unittest
from pathlib import Path

from rostest_support import MeshWatch, call

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from fenced_blocks import ROOT, blocks  # noqa: E402

from drone_mesh.srv import SetSpeed  # noqa: E402

COMMAND_LIMIT_S = 60.0
CONNECTED_WITHIN_S = 60.0  # simulated


def is_endless(command: str) -> bool:
    """Whether it prints until Ctrl-C."""
    return "--watch" in command or (command.startswith("rostopic echo") and " -n " not in command)


class DocumentationTest(unittest.TestCase):
    def run_command(self, command: str) -> None:
        process = subprocess.Popen(
            ["bash", "-c", f"source scripts/env.bash && exec {command}"],
            cwd=str(ROOT),
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            start_new_session=True,
        )
        timer = threading.Timer(COMMAND_LIMIT_S, os.killpg, (process.pid, signal.SIGKILL))
        timer.start()
        first = process.stdout.readline() if is_endless(command) else ""
        if first:
            os.killpg(process.pid, signal.SIGINT)
        printed = first + process.communicate()[0]
        timer.cancel()
        self.assertNotEqual(
            process.returncode, -signal.SIGKILL, f"not done after {COMMAND_LIMIT_S:g} s: {command}"
        )
        self.assertNotIn("Traceback", printed, command)
        if not is_endless(command):
            self.assertEqual(process.returncode, 0, f"{command}\n{printed}")

    def test_each_command_beside_a_simulation_works(self) -> None:
        mesh = MeshWatch(6)
        mesh.switch(2, True)  # the test before has switched it off
        mesh.wait("not all nodes are connected", CONNECTED_WITHIN_S, mesh.connected)
        call("/DroneFactory/setSpeed", SetSpeed, False, 1.0)
        tested = [block for block in blocks("bash") if block.test == "simulation"]
        commands = [command for block in tested for command in block.commands()]
        self.assertGreater(len(commands), 5)
        for command in commands:
            if not command.startswith("source "):  # each command has a shell of its own
                self.run_command(command)
