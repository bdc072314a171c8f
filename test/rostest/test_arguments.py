#!/usr/bin/env python3
"""What roslaunch makes of arguments; an invalid one ends the launch with one line that says why.

The effect of a parameter is tested where it is read.
"""

from __future__ import annotations

import contextlib
import io
import os
import socket
import subprocess
import sys
import unittest
import xml.etree.ElementTree as ET
from dataclasses import fields
from pathlib import Path
from unittest import mock

import rosgraph
import roslaunch
import rostest
import yaml
from rostest_support import WALL_LIMIT_S, free_port, in_order, preload, program, run_program

from drone_mesh.configuration import FactoryConfiguration
from drone_mesh.ros.graph import launching

LAUNCH = Path(__file__).resolve().parents[2] / "launch"
OUR_LAUNCH = ("python3", "-m", "drone_mesh.ros.graph.launching")  # roslaunch exits with 0
WITH_CONSOLE = ("console:=true", "simulator:=false", "manager:=false")


def printed(option: str, file: str, *arguments: str) -> str:
    """What `roslaunch OPTION FILE ARGUMENT...` prints, without a process of its own."""
    out, words = io.StringIO(), ["roslaunch", option, str(LAUNCH / file), *arguments]
    given = mock.patch.object(sys, "argv", words)  # from where it takes the arguments
    with given, contextlib.redirect_stdout(out), contextlib.suppress(SystemExit):
        roslaunch.main(words)
    return out.getvalue()


def nodes(*arguments: str) -> set[str]:
    return set(printed("--nodes", "factory.launch", *arguments).split())


def parameters(file: str, *arguments: str) -> dict[str, object]:
    return dict(yaml.safe_load(printed("--dump-params", file, *arguments)))


def names_in(file: str) -> set[str]:
    return {arg.get("name", "") for arg in ET.parse(LAUNCH / file).getroot().findall("arg")}


class LaunchArgumentsTest(unittest.TestCase):
    def test_each_setting_reaches_the_factory_and_what_the_simulator_shares_reaches_it_too(
        self,
    ) -> None:
        settings = {field.name for field in fields(FactoryConfiguration)}
        self.assertLessEqual(settings, names_in("factory.launch"))
        values = {name: f"value of {name}" for name in {*settings, "config"}}
        found = parameters("factory.launch", *(f"{n}:={value}" for n, value in values.items()))
        for name, value in values.items():
            self.assertEqual(found[f"/DroneFactory/{name}"], value)
        for name in ("config", "max_distance", "obstacles", "obstacle_radio"):
            self.assertEqual(found[f"/WirelessSignalSimulator/{name}"], values[name])

    def test_other_arguments_of_the_factory_reach_the_manager_and_the_console(self) -> None:
        found = parameters(
            "factory.launch", "casus:=/my.yaml", "origin:=1,2,3", "demo:=repair",
            "console_port:=99", "tiles:=/my.mbtiles", "hosts:=2",
        )  # fmt: skip
        self.assertEqual(found["/DroneManager/casus"], "/my.yaml")
        self.assertEqual(found["/drone_mesh/origin"], "1,2,3")
        self.assertEqual(found["/mesh_console/demo"], "repair")
        self.assertEqual(found["/mesh_console/port"], "99")
        self.assertEqual(found["/mesh_console/tiles"], "/my.mbtiles")
        found_of_station = parameters(
            "factory.launch", "ground_station:=tcp:127.0.0.1:0", "cot:=udp:127.0.0.1:6969",
            "ground_station_may_order:=true", "ground_station_key:=/my.key",
        )  # fmt: skip
        values = {n: found_of_station[f"/ground_station/{n}"] for n in ("may_order", "key_file")}
        self.assertEqual(values, {"may_order": True, "key_file": "/my.key"})
        hosts = [(found[f"/mesh_host_{n}/index"], found[f"/mesh_host_{n}/hosts"]) for n in (1, 2)]
        self.assertEqual(hosts, [(1, 2), (2, 2)])

    def test_switches_start_a_node_or_leave_it_out(self) -> None:
        base = nodes()
        self.assertEqual(base, {"/WirelessSignalSimulator", "/DroneManager", "/DroneFactory"})
        self.assertEqual(base - nodes("simulator:=false"), {"/WirelessSignalSimulator"})
        self.assertEqual(base - nodes("manager:=false"), {"/DroneManager"})
        self.assertEqual(nodes("actions:=true") - base, {"/fly_actions"})
        stations = nodes("ground_station:=tcp:127.0.0.1:0"), nodes("cot:=udp:127.0.0.1:6969")
        self.assertEqual(stations, (base | {"/ground_station"},) * 2)
        self.assertEqual(nodes("console:=true") - base, {"/mesh_console"})
        self.assertEqual(nodes("demo:=repair") - base, {"/mesh_console"})
        self.assertEqual(nodes("rviz:=true") - base, {"/mesh_markers", "/mesh_rviz"})
        self.assertEqual(nodes("hosts:=2") - base, {"/mesh_host_1", "/mesh_host_2"})
        self.assertEqual(nodes("hosts:=0"), base)
        alone = nodes("namespace:=site_a", "simulator:=false", "manager:=false")
        self.assertEqual(alone, {"/site_a/DroneFactory"})

    def test_an_empty_world_has_no_drones_and_its_own_settings(self) -> None:
        own = {"gui": "true", "real_time_factor": "3", "max_distance": "4", "config": "/my.yaml"}
        self.assertEqual(names_in("empty_world.launch"), own.keys())
        found = parameters("empty_world.launch", *(f"{n}:={value}" for n, value in own.items()))
        self.assertEqual(
            (found["/DroneFactory/gateways"], found["/DroneFactory/routers"]), ("0", "0")
        )
        for name, value in own.items():
            self.assertEqual(found[f"/DroneFactory/{name}"], value)

    def test_each_argument_of_the_console_is_a_parameter(self) -> None:
        names = sorted(names_in("console.launch"))
        values = {name: f"value of {name}" for name in names}
        found = parameters("console.launch", *(f"{n}:={value}" for n, value in values.items()))
        for name, value in values.items():
            self.assertEqual(found[f"/mesh_console/{name}"], value)

    def test_a_host_has_its_nodes(self) -> None:
        found = parameters("host.launch", "first:=3", "last:=5")
        self.assertEqual((found["/mesh_host_3_5/first"], found["/mesh_host_3_5/last"]), (3, 5))

    def test_recorder_player_and_rviz_get_their_options(self) -> None:
        def line(file: str, node: str, *arguments: str) -> str:
            return printed(f"--args={node}", file, *arguments)

        record = ("record.launch", "/mesh_recorder", "bag:=/my/run")
        self.assertIn("--lz4 --buffsize", line(*record))
        self.assertIn("--bz2 --buffsize", line(*record, "compression:=bz2"))
        self.assertNotIn("--lz4", line(*record, "compression:=none"))
        self.assertIn("-o /my/run", line(*record))
        replay = ("replay.launch", "bag:=/my.bag", "rate:=2", "start:=7", "port:=99", "tiles:=/t")
        self.assertIn("--rate 2 --start 7 /my.bag", line(replay[0], "/mesh_replay", *replay[1:]))
        found = parameters(*replay, "origin:=1,2,3")
        console = {"recording": "/my.bag", "port": "99", "origin": "1,2,3", "tiles": "/t"}
        for name, value in console.items():
            self.assertEqual(found[f"/mesh_console/{name}"], value)
        shown = printed("--nodes", *replay, "console:=false", "rviz:=true").split()
        self.assertEqual(set(shown), {"/mesh_replay", "/mesh_markers", "/mesh_rviz"})
        rviz = line("rviz.launch", "/mesh_rviz", "rviz_config:=/my.rviz")
        self.assertIn("-d /my.rviz", rviz)
        hidden = printed("--nodes", "rviz.launch", "window:=false").split()
        self.assertEqual(hidden, ["/mesh_markers"])


def ended(*command: str, **environment: str) -> subprocess.CompletedProcess[str]:
    """What a command said, and its exit code, once it has ended by itself."""
    return subprocess.run(
        command,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        env={**os.environ, **environment},
        timeout=WALL_LIMIT_S,
        check=False,
        text=True,
    )


def launched(*arguments: str, by: tuple[str, ...] = OUR_LAUNCH) -> subprocess.CompletedProcess[str]:
    port = free_port()
    words = (*by, "-p", str(port), "drone_mesh", "factory.launch", *arguments)
    return ended(*words, ROS_MASTER_URI=f"http://127.0.0.1:{port}")


def refused(*arguments: str, uri: str = "") -> object:
    """With what OUR_LAUNCH exits before it starts anything, without a process of its own."""
    words = ["roslaunch", "drone_mesh", "factory.launch", *arguments]
    given = mock.patch.object(sys, "argv", words)
    master = mock.patch.dict(os.environ, {"ROS_MASTER_URI": uri} if uri else {})
    starts = mock.patch.object(roslaunch, "main", side_effect=AssertionError("it starts"))
    try:
        with given, master, starts:
            launching.main()
    except SystemExit as end:
        return end.code
    raise AssertionError("it starts")


class BadArgumentsTest(unittest.TestCase):
    def test_a_node_that_refuses_its_arguments_ends_the_whole_launch(self) -> None:
        launch = launched("max_distance:=-1")
        line = "/DroneFactory: argument: invalid max_distance '-1': expected metres"
        self.assertIn(line, launch.stdout)
        self.assertIn("exit code 1", launch.stdout)
        self.assertEqual(launch.returncode, 1)
        # A node that is stopped while Python itself is starting prints a traceback.
        until_failure, shutdown, _ = launch.stdout.partition("Initiating shutdown!")
        self.assertTrue(shutdown, launch.stdout)
        self.assertNotIn("Traceback", until_failure)

    def test_layouts_that_the_manager_cannot_read_are_refused_by_the_factory(self) -> None:
        """roslaunch would start the manager again and again, but ends with the factory."""
        master = rosgraph.Master("/test_arguments")
        master.setParam("/DroneManager/casus", "/no/such.yaml")
        self.addCleanup(master.deleteParam, "/DroneManager/casus")
        factory = run_program("drone_factory", "__name:=f")
        line = "/f: casus:=/no/such.yaml: No such file or directory"
        self.assertIn(line, factory.stdout + factory.stderr)
        self.assertEqual(factory.returncode, 1)

    def test_the_factory_names_what_it_refuses_in_one_line(self) -> None:
        # Each with a name of its own: what was given remains on the master, as a parameter.
        for name, argument, line in (
            ("a", "hosts:=many", "argument: invalid hosts 'many': expected a whole number"),
            ("b", "obstacles:=/no/such.yaml", "obstacles: /no/such.yaml: No such"),
            ("c", "config:=/tmp", "config:=/tmp: Is a directory"),
            ("d", "config:=mine.yaml", "config:=mine.yaml: no such file in "),
            ("e", "key:=/no/such", "key: /no/such: No such file or directory"),
        ):
            factory = run_program("drone_factory", f"__name:={name}", f"_{argument}")
            said = factory.stdout + factory.stderr
            self.assertIn(line, said)
            self.assertNotIn("Traceback", said)
            self.assertEqual(factory.returncode, 1, said)

    def test_before_anything_starts_a_bad_namespace_and_a_bad_address_are_refused(self) -> None:
        name = "must be letters, digits and _, and begin with a letter"
        address = "is no address of a master: it must look like http://localhost:11311"
        for argument, uri, line in (
            ("namespace:=site-a", "", f"invalid namespace 'site-a': {name}"),
            ("namespace:=01", "", f"invalid namespace '01': {name}"),
            ("namespace:=site a", "", f"invalid namespace 'site a': {name}"),
            ("routers:=2", "localhost:11311", f"ROS_MASTER_URI=localhost:11311 {address}"),
        ):
            self.assertEqual(refused(argument, uri=uri), f"roslaunch: {line}")

    def test_the_nodes_themselves_refuse_such_a_namespace(self) -> None:
        factory = ended(*program("drone_factory", "__ns:=/site-a"))
        self.assertIn("drone_factory: invalid namespace '/site-a/'", factory.stdout)
        self.assertEqual(factory.returncode, 2)
        # Beside the factory, which says it for both.
        manager = program("drone_manager", "__ns:=/site-a")
        silent = ended(*manager, DRONE_MESH_SPEAKER="DroneFactory")
        self.assertEqual((silent.stdout, silent.returncode), ("", 2))

    def test_what_the_console_cannot_use_is_said_before_anything_starts(self) -> None:
        port = "invalid port 99999: must be a whole number 0..65535"
        with socket.create_server(("127.0.0.1", 0)) as other:
            used = str(other.getsockname()[1])
            for argument, line in (
                ("console_port:=99999", port),
                (f"console_port:={used}", used),
                ("origin:=abc", "invalid origin 'abc'"),
            ):
                self.assertIn(line, str(refused(*WITH_CONSOLE, argument)))
        launch = launched(*WITH_CONSOLE, "console_port:=abc", by=("roslaunch",))
        (said,) = [line for line in launch.stdout.splitlines() if line.startswith("console: ")]
        self.assertIn("invalid port abc", said)
        self.assertNotIn("espawning", launch.stdout)
        console = run_program("console", "_port:=99999")
        self.assertIn(f"console: {port}", console.stderr)


def suite() -> unittest.TestSuite:
    return in_order(LaunchArgumentsTest, BadArgumentsTest)


if __name__ == "__main__":
    preload("drone_mesh.ros.world.drone_factory_node", "drone_mesh.ros.views.console_node")
    rostest.rosrun("drone_mesh", "arguments", "__main__.suite")
