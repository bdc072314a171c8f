#!/usr/bin/env python3
"""Two network namespaces as two machines: the world in one, half of the nodes in the other."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import unittest
from typing import Iterator

import rostest

HERE, THERE = "10.213.77.1", "10.213.77.2"
PORT = "11377"
DRONES = 6  # gateway 0, routers 1..5
ASK_CONNECTED = f"""
import rospy, time
from drone_mesh.msg import NodeDebugInfo
rospy.init_node("asker", anonymous=True, disable_signals=True)
connected = {{}}
for node in range({DRONES}):
    rospy.Subscriber(f"/Nodes/{{node}}/debug", NodeDebugInfo,
                     lambda info: connected.__setitem__(info.nodeID, info.ConnectedWithGateway))
deadline_s = time.monotonic() + 60
found = []
while time.monotonic() < deadline_s and len(found) < {DRONES}:
    time.sleep(0.05)
    found = sorted(node for node, is_connected in list(connected.items()) if is_connected)
print(found)
"""


def run(*command: str) -> None:
    subprocess.run(command, check=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)


@contextlib.contextmanager
def two_namespaces() -> Iterator[tuple[str, str]]:
    """Two namespaces connected by a virtual cable. Skips the test where they are forbidden."""
    names = (f"mesh_a_{os.getpid()}", f"mesh_b_{os.getpid()}")
    with contextlib.ExitStack() as undo:
        try:
            for name in names:
                run("ip", "netns", "add", name)
                undo.callback(run, "ip", "netns", "del", name)
            cable = ("type", "veth", "peer", "name", "mesh0", "netns", names[1])
            run("ip", "link", "add", "mesh0", "netns", names[0], *cable)
            # A chroot or container may allow the namespaces and refuse what is done in them.
            for name, address in zip(names, (HERE, THERE)):
                run("ip", "-n", name, "address", "add", f"{address}/24", "dev", "mesh0")
                for device in ("mesh0", "lo"):
                    run("ip", "-n", name, "link", "set", device, "up")
        except (OSError, subprocess.CalledProcessError) as error:
            output = getattr(error, "output", None) or error
            raise unittest.SkipTest(f"no network namespaces here: {output}") from None
        yield names


def start(namespace: str, address: str, *command: str, **options: object) -> subprocess.Popen:
    environment = {**os.environ, "ROS_MASTER_URI": f"http://{HERE}:{PORT}", "ROS_IP": address}
    environment.pop("ROS_HOSTNAME", None)
    return subprocess.Popen(
        ["ip", "netns", "exec", namespace, *command],
        env=environment,
        start_new_session=True,
        text=True,
        **options,
    )


@contextlib.contextmanager
def launched(namespace: str, address: str, *arguments: str) -> Iterator[None]:
    launch = start(namespace, address, "roslaunch", *arguments)
    try:
        yield
    finally:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(launch.pid, signal.SIGINT)
        try:
            launch.wait(timeout=20)
        except subprocess.TimeoutExpired:
            os.killpg(launch.pid, signal.SIGKILL)
            launch.wait()


class NamespacesTest(unittest.TestCase):
    def test_all_are_connected_over_the_cable(self) -> None:
        world = (
            "-p",
            PORT,
            "drone_mesh",
            "factory.launch",
            "hosts:=0",
            "routers:=5",
            "manager:=false",
        )
        first = ("--wait", "drone_mesh", "host.launch", "first:=0", "last:=2")
        second = ("--wait", "drone_mesh", "host.launch", "first:=3", "last:=5")
        with contextlib.ExitStack() as stack:
            here, there = stack.enter_context(two_namespaces())
            stack.enter_context(launched(here, HERE, *world))

            stack.enter_context(launched(here, HERE, *first))
            stack.enter_context(launched(there, THERE, *second))
            asker = start(there, THERE, sys.executable, "-c", ASK_CONNECTED, stdout=subprocess.PIPE)
            connected, _ = asker.communicate(timeout=90)
            self.assertEqual(connected.strip().splitlines()[-1], str(list(range(DRONES))))


if __name__ == "__main__":
    rostest.rosrun("drone_mesh", "namespaces", NamespacesTest)
