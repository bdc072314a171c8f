#!/usr/bin/env python3
"""An invalid argument of the console ends the whole launch, with one line that says why."""

from __future__ import annotations

import os
import socket
import subprocess
import unittest

import rostest
from rostest_support import WALL_LIMIT_S, free_port

LAUNCH = ("python3", "-m", "drone_mesh.ros.graph.launching")  # as scripts/run
WITH_CONSOLE = ("console:=true", "simulator:=false", "manager:=false")


class ConsoleArgumentsTest(unittest.TestCase):
    def refuses(self, launch: tuple[str, ...], line: str, *arguments: str) -> int:
        """Returns the exit status. Our own launch says it before anything starts."""
        port = free_port()
        ended = subprocess.run(
            [*launch, "-p", str(port), "drone_mesh", "factory.launch", *WITH_CONSOLE, *arguments],
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            env={**os.environ, "ROS_MASTER_URI": f"http://127.0.0.1:{port}"},
            timeout=WALL_LIMIT_S,
            check=False,
            text=True,
        )
        said = ended.stdout.splitlines()
        if launch is not LAUNCH:
            said = [line for line in said if line.startswith("console: ")]
        self.assertEqual(len(said), 1, ended.stdout)
        self.assertIn(line, said[0])
        self.assertNotIn("espawning", ended.stdout)
        return ended.returncode

    def test_a_port_of_the_console_that_is_none(self) -> None:
        line = "invalid port 99999: must be a whole number 0..65535"
        self.assertEqual(self.refuses(LAUNCH, line, "console_port:=99999"), 1)
        self.refuses(("roslaunch",), line, "console_port:=99999")

    def test_a_port_of_the_console_that_is_in_use(self) -> None:
        with socket.create_server(("127.0.0.1", 0)) as other:
            port = other.getsockname()[1]
            given = f"console_port:={port}"
            self.assertEqual(self.refuses(LAUNCH, f"{port}", given), 1)

    def test_an_origin_that_is_none(self) -> None:
        self.assertEqual(self.refuses(LAUNCH, "invalid origin 'abc'", "origin:=abc"), 1)


if __name__ == "__main__":
    rostest.rosrun("drone_mesh", "console_arguments", ConsoleArgumentsTest)
