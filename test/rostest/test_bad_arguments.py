#!/usr/bin/env python3
"""An invalid argument ends the whole launch, with one line that says what is wrong."""

from __future__ import annotations

import os
import subprocess
import unittest

import rostest
from rostest_support import WALL_LIMIT_S, free_port

LAUNCH = (
    "python3",
    "-m",
    "drone_mesh.ros.graph.launching",
)  # as scripts/run; roslaunch exits with 0
ALONE = ("simulator:=false", "manager:=false")  # what ends a launch does so with and without these


class BadArgumentsTest(unittest.TestCase):
    def launch_and_expect(self, line: str, *arguments: str) -> None:
        port = free_port()
        launch = subprocess.run(
            [*LAUNCH, "-p", str(port), "drone_mesh", "factory.launch", *arguments],
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            env={**os.environ, "ROS_MASTER_URI": f"http://127.0.0.1:{port}"},
            timeout=WALL_LIMIT_S,
            check=False,
            text=True,
        )
        self.assertIn(f"/DroneFactory: {line}", launch.stdout)
        self.assertIn("exit code 1", launch.stdout)
        self.assertEqual(launch.returncode, 1)
        # A node that is stopped while Python itself is starting prints a traceback.
        until_failure, shutdown, _ = launch.stdout.partition("Initiating shutdown!")
        self.assertTrue(shutdown, launch.stdout)
        self.assertNotIn("Traceback", until_failure)

    def refuse(self, argument: str, line: str, **environment: str) -> None:
        """Nothing starts."""
        launch = subprocess.run(
            [*LAUNCH, "drone_mesh", "factory.launch", argument],
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            env={**os.environ, **environment},
            timeout=WALL_LIMIT_S,
            check=False,
            text=True,
        )
        self.assertEqual(launch.stdout, f"roslaunch: {line}\n")
        self.assertEqual(launch.returncode, 1)

    def test_a_namespace_in_which_topics_have_no_valid_name(self) -> None:
        for namespace in ("site-a", "01", "site a"):
            self.refuse(
                f"namespace:={namespace}",
                f"invalid namespace {namespace!r}: must be letters, digits and _, and begin with a "
                "letter",
            )

    def test_the_nodes_themselves_refuse_such_a_namespace(self) -> None:
        port = free_port()
        launch = subprocess.run(
            ["roslaunch", "-p", str(port), "drone_mesh", "factory.launch", "namespace:=site-a"],
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            env={**os.environ, "ROS_MASTER_URI": f"http://127.0.0.1:{port}"},
            timeout=WALL_LIMIT_S,
            check=False,
            text=True,
        )
        said = [line for line in launch.stdout.splitlines() if "invalid namespace" in line]
        self.assertEqual(len(said), 1, said)
        self.assertIn("drone_factory: invalid namespace '/site-a/'", said[0])

    def test_an_address_of_a_master_without_http(self) -> None:
        self.refuse(
            "routers:=2",
            "ROS_MASTER_URI=localhost:11311 is no address of a master: it must look like "
            "http://localhost:11311",
            ROS_MASTER_URI="localhost:11311",
        )

    def test_a_number_that_is_out_of_bounds(self) -> None:
        line = "argument: invalid max_distance '-1': expected metres"
        self.launch_and_expect(line, "max_distance:=-1")

    def test_a_number_that_is_none(self) -> None:
        line = "argument: invalid hosts 'many': expected a whole number"
        self.launch_and_expect(line, "hosts:=many", *ALONE)

    def test_a_file_of_layouts_that_is_not_there(self) -> None:
        given = "casus:=/no/such.yaml"
        self.launch_and_expect(f"{given}: No such file or directory", given)

    def test_a_file_of_obstacles_that_is_not_there(self) -> None:
        line = "obstacles: /no/such.yaml: No such"
        self.launch_and_expect(line, "obstacles:=/no/such.yaml", *ALONE)

    def test_a_directory_in_place_of_a_configuration(self) -> None:
        self.launch_and_expect("config:=/tmp: Is a directory", "config:=/tmp", *ALONE)

    def test_a_configuration_in_another_folder(self) -> None:
        self.launch_and_expect("config:=mine.yaml: no such file in ", "config:=mine.yaml", *ALONE)

    def test_a_key_file_that_is_not_there(self) -> None:
        self.launch_and_expect("key: /no/such: No such file or directory", "key:=/no/such", *ALONE)


if __name__ == "__main__":
    rostest.rosrun("drone_mesh", "bad_arguments", BadArgumentsTest)
