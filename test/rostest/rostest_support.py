"""What the rostests share: the mesh as its debug topics show it, strangers, and deadlines."""

from __future__ import annotations

import functools
import importlib
import multiprocessing
import os
import queue
import re
import runpy
import signal
import socket
import subprocess
import sys
import tempfile
import time
import unittest
from pathlib import Path
from typing import Callable, Iterable
from xmlrpc.client import ServerProxy

import rosgraph
import rospkg
import rospy
from rosgraph_msgs.msg import Clock, Log

from drone_mesh.msg import NRF24, DroneInfo, Location, MeshState, NodeDebugInfo
from drone_mesh.srv import Casus, PowerSwitch, RequestGPS, RequestGPSResponse, WirelessMessage

PAYLOAD_BYTES = 32
STANDSTILL_S = 20.0  # wall; if simulated time has begun and stands still, the world has died
CLOCK_REST_S = 0.1  # wall
POLL_PERIOD_S = 0.05  # many conditions call a service, which takes both sides milliseconds
WALL_LIMIT_S = 60.0  # for what takes a moment on an idle machine
NODES = Path(rospkg.RosPack().get_path("drone_mesh")) / "nodes"
FORKS = multiprocessing.get_context("forkserver")
FORKS.set_forkserver_preload(["__main__"])
# The package of a devel space puts src/ first, where the messages are missing. Python 3.13 gives
# this path to the process that forks.
sys.path[:] = [path for path in sys.path if path != str(NODES.parent / "src")]


@functools.lru_cache(maxsize=None)  # once in each process
def rest_between_ticks() -> None:
    """Let rospy read the clock only this often: at eight times real time it ticks 800 times a s."""
    rospy.Subscriber("clock", Clock, lambda _tick: time.sleep(CLOCK_REST_S), queue_size=1)


def in_order(*cases: type[unittest.TestCase]) -> unittest.TestSuite:
    """The tests of classes that share a launch, one class after the other."""
    return unittest.TestSuite(map(unittest.TestLoader().loadTestsFromTestCase, cases))


def wait_for(what: str, within_s: float, condition: Callable[[], object]) -> None:
    """Return when `condition` holds; AssertionError after `within_s` of wall time."""
    deadline_s = time.monotonic() + within_s
    while not condition():
        if time.monotonic() > deadline_s:
            raise AssertionError(f"timed out: {what}, waited {within_s:g} s")
        time.sleep(POLL_PERIOD_S)


def call(service: str, service_class: type, *arguments: object) -> object:
    """Call a service as soon as it is offered."""
    proxy = rospy.ServiceProxy(service, service_class)
    try:
        return proxy(*arguments)
    except rospy.ServiceException as error:
        if not re.match(r"service \S+ unavailable$|unable to connect", str(error)):
            raise
    rospy.wait_for_service(service, timeout=WALL_LIMIT_S)
    return proxy(*arguments)


def program(name: str, *arguments: str) -> list[str]:
    """The command line of a program of the package, without rosrun: that takes a second."""
    return [sys.executable, str(NODES / name), *arguments]


def run_program(name: str, *arguments: str, **environment: str) -> subprocess.CompletedProcess[str]:
    """Run a program of the package until its end, in a fork of one process.

    That process has imported what the test needs and `preload` names: nearly all of their time.
    """
    words = [str(NODES / name), *arguments]
    with tempfile.TemporaryDirectory() as folder:
        out, errors = Path(folder) / "out", Path(folder) / "errors"
        process = FORKS.Process(target=_run_fork, args=(words, environment, out, errors))
        process.start()
        process.join(WALL_LIMIT_S)
        assert process.exitcode is not None, f"{name} did not end"
        return subprocess.CompletedProcess(
            words, process.exitcode, out.read_text("utf-8"), errors.read_text("utf-8")
        )


def preload(*modules: str) -> None:
    """Let these modules be imported once, before the first fork."""
    FORKS.set_forkserver_preload(["__main__", *modules])


def _run_fork(words: list[str], environment: dict[str, str], out: Path, errors: Path) -> None:
    for number, path in ((1, out), (2, errors)):
        os.dup2(os.open(path, os.O_WRONLY | os.O_CREAT), number)
    os.environ.update(environment)
    sys.argv = words
    if any(word.startswith("__ns:=") for word in words):
        importlib.reload(sys.modules["rospy.names"])  # which takes it when it is imported
    try:
        runpy.run_path(words[0], run_name="__main__")
    finally:
        rospy.signal_shutdown("the program has ended")  # as at the end of a process of its own


def free_port() -> int:
    """A free TCP port for a separate master."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def pid_of(node: str) -> int | None:
    """Process id of a ROS node; None if it does not answer."""
    try:
        uri = rosgraph.Master("/rostest").lookupNode(node)
        return int(ServerProxy(uri).getPid("/rostest")[2])
    except (OSError, rosgraph.MasterException):
        return None


def receives(node: str, topic: str, publisher: str) -> bool:
    """Whether `node` is connected to a topic of `publisher`; the master knows that too early."""
    uri = rosgraph.Master("/rostest").lookupNode(publisher)
    _code, _text, connections = ServerProxy(uri).getBusInfo("/rostest")
    return any(other == node and name == topic for _, other, _, _, name, *_ in connections)


def kill_and_wait_for_respawn(node: str) -> None:
    """SIGKILL; returns when roslaunch has started it again."""
    old_pid = pid_of(node)
    assert old_pid is not None, f"{node} is not running, so it cannot be killed"
    os.kill(old_pid, signal.SIGKILL)
    wait_for(f"{node} was not respawned", WALL_LIMIT_S, lambda: pid_of(node) not in (None, old_pid))


def send_home(*places: tuple[float, float]) -> None:
    """Let the engines fly drones 1, 2 and so on to these places, for the next test of a launch."""
    goals = {f"/Drones/{drone}": place for drone, place in enumerate(places, start=1)}
    for drone, (longitude, latitude) in goals.items():
        goal = rospy.Publisher(f"{drone}/goal", Location, queue_size=1, latch=True)
        goal.publish(Location(latitude, longitude, 0))
    for drone, (longitude, latitude) in goals.items():
        there = RequestGPSResponse(latitude, longitude, 0)
        asked = (f"{drone}/gps", RequestGPS)
        wait_for(f"{drone} at its start", WALL_LIMIT_S, lambda: call(*asked) == there)  # noqa: B023


class LogWatch:
    """Everything that goes to the log from now on."""

    def __init__(self) -> None:
        self._lines: list[Log] = []
        self._subscriber = rospy.Subscriber("/rosout", Log, self._lines.append)

    def lines(self, text: str, level: int = Log.DEBUG) -> list[str]:
        """The lines that contain this text, of this level or above it."""
        lines = list(self._lines)
        return [line.msg for line in lines if text in line.msg and line.level >= level]

    def failures(self) -> list[str]:
        """Lines of unexpected exceptions."""
        return self.lines("Traceback") + self.lines("bad callback") + self.lines("in a mesh node")


class StateWatch:
    """`/mesh/state`, without a subscription for each report, which costs both sides a handshake."""

    def __init__(self) -> None:
        self._reports: queue.SimpleQueue[MeshState] = queue.SimpleQueue()
        self._subscriber = rospy.Subscriber("/mesh/state", MeshState, self._reports.put)

    def next(self) -> MeshState:
        """The first report from now on; queue.Empty if there is none."""
        while not self._reports.empty():
            self._reports.get()
        return self._reports.get(timeout=WALL_LIMIT_S)


class MeshWatch:
    """The nodes 0..count-1, from their debug topics. Times are simulated seconds."""

    def __init__(self, count: int, every_tick: bool = False) -> None:
        """`every_tick`: the test follows each tick of the clock."""
        if not every_tick:
            rest_between_ticks()
        self.count = count
        self._infos: dict[int, NodeDebugInfo] = {}
        self._unconnected_in_a_row: dict[int, int] = {}
        for node_id in range(count):
            rospy.Subscriber(f"/Nodes/{node_id}/debug", NodeDebugInfo, self._heard)

    def _heard(self, info: NodeDebugInfo) -> None:
        before = self._unconnected_in_a_row.get(info.nodeID, 0)
        self._unconnected_in_a_row[info.nodeID] = 0 if info.ConnectedWithGateway else before + 1
        self._infos[info.nodeID] = info

    def hops(self) -> dict[int, int | None]:
        """Hops of each node that was heard of; None while it is not connected."""
        return {
            node_id: info.hops if info.ConnectedWithGateway else None
            for node_id, info in sorted(self._infos.items())
        }

    def connected(self, node_ids: Iterable[int] | None = None) -> bool:
        """Whether these nodes (default: all) are connected."""
        hops = self.hops()
        wanted = range(self.count) if node_ids is None else node_ids
        return all(hops.get(node_id) is not None for node_id in wanted)

    def forget(self, *node_ids: int) -> None:
        """Forget what these nodes reported: only what they report from now on counts."""
        for node_id in node_ids:
            self._infos.pop(node_id, None)
            self._unconnected_in_a_row.pop(node_id, None)

    def lost(self, *node_ids: int) -> bool:
        """Whether these nodes reported twice in a row, a second apart, that they are not connected.

        One report alone may be of a moment in which the node changes its route.
        """
        return all(self._unconnected_in_a_row.get(node_id, 0) >= 2 for node_id in node_ids)

    def off(self, node_id: int) -> bool:
        """Whether the node reports that its antenna has no power."""
        return not self._infos[node_id].on

    def info(self, node_id: int) -> NodeDebugInfo:
        """The node's latest report."""
        return self._infos[node_id]

    def wait(self, what: str, within_s: float, condition: Callable[[], object]) -> float:
        """Return the simulated seconds that it took; AssertionError after `within_s` of them."""
        begun_s = moved_s = rospy.get_time()
        moved_wall_s = time.monotonic()
        while not condition():
            now_s = rospy.get_time()
            if now_s != moved_s:
                moved_s, moved_wall_s = now_s, time.monotonic()
            if now_s - begun_s > within_s and begun_s > 0.0:
                raise AssertionError(
                    f"timed out: {what}, waited {within_s:g} simulated s; hops now: {self.hops()}"
                )
            if time.monotonic() - moved_wall_s > (STANDSTILL_S if now_s else WALL_LIMIT_S):
                raise AssertionError(f"the world died: waited for '{what}', the clock stands still")
            begun_s = begun_s or now_s
            time.sleep(POLL_PERIOD_S)
        return rospy.get_time() - begun_s

    def pass_time(self, duration_s: float) -> None:
        """Let simulated time go by."""
        end_s = rospy.get_time() + duration_s
        self.wait(f"{duration_s} s go by", 2 * duration_s, lambda: rospy.get_time() >= end_s)

    def place(self, node_id: int) -> tuple[float, float, int]:
        """Longitude, latitude and height of the drone, from its gps service."""
        answer = call(f"/Drones/{node_id}/gps", RequestGPS)
        return (answer.longitude, answer.latitude, answer.height)

    def wait_at(self, node_id: int, longitude: float, latitude: float, within_s: float) -> None:
        """Return when the drone stands there; AssertionError after `within_s` simulated seconds."""
        self.wait(
            f"drone {node_id} at ({longitude:g}, {latitude:g})",
            within_s,
            lambda: self.stands_at(node_id, longitude, latitude),
        )

    def stands_at(self, node_id: int, longitude: float, latitude: float) -> bool:
        """Whether it is within 0.05 m, and nearer to the ground than to a height of 1 m."""
        x, y, height = self.place(node_id)
        return abs(x - longitude) <= 0.05 and abs(y - latitude) <= 0.05 and height == 0

    def switch(self, node_id: int, on: bool) -> None:
        """Use a node's power switch."""
        call(f"/Nodes/{node_id}/powerSwitch", PowerSwitch, on)

    def set_to_case(self, case: int) -> None:
        """Order a layout."""
        call("/DroneManager/SetToCasus", Casus, case)


class Stranger:
    """A foreign node: it follows the wire contract and stores what it receives."""

    def __init__(self, node_id: int, topic: str, place: tuple[float, float, float]) -> None:
        self.node_id = node_id
        self.heard: list[bytes] = []
        self._topic, self._place = topic, place
        self._publisher = rospy.Publisher("/WirelessSignalSimulator", DroneInfo, queue_size=100)
        self.subscriber = rospy.Subscriber(topic, NRF24, lambda packet: self._hear(packet))

    def _hear(self, packet: NRF24) -> None:
        self.heard.append(bytes(packet.payload))

    def announce(
        self, position: tuple[float, float, float], sub: str = "", on: bool = True
    ) -> None:
        """Publish one DroneInfo about itself."""
        self._publisher.publish(DroneInfo(self.node_id, position, sub, on))

    def register(self) -> None:
        """Return when the simulator has registered it and can send to it."""
        wait_for("no simulator", WALL_LIMIT_S, lambda: self._publisher.get_num_connections() > 0)
        hello = bytes((self.node_id, self.node_id, 0, self.node_id, self.node_id))

        def reachable() -> bool:
            self.announce(self._place, self._topic)  # others may subscribe before the simulator
            return self.send(hello) and hello.ljust(PAYLOAD_BYTES, b"\0") in self.heard

        wait_for(f"stranger {self.node_id} was not registered", WALL_LIMIT_S, reachable)
        self.heard.clear()

    def leave(self) -> None:
        """Switch it off: the world waits for each packet to it, as no host reports that it came."""
        self.announce(self._place, self._topic, on=False)

    def send(self, packet: bytes) -> bool:
        """Send to the node in byte 3; True: that node received it."""
        message = NRF24(packet.ljust(PAYLOAD_BYTES, b"\0"))
        answer = call("/SignalSimulator/message", WirelessMessage, packet[1], packet[3], message)
        return bool(answer.succes)

    def wait_for_packet(self, start: bytes, what: str) -> bytes:
        """The first packet heard that starts like this."""
        found: list[bytes] = []

        def came() -> bool:
            found.extend(packet for packet in list(self.heard) if packet.startswith(start))
            return bool(found)

        wait_for(f"{what} (packet {start.hex()}..); heard {len(self.heard)}", WALL_LIMIT_S, came)
        return found[0]
