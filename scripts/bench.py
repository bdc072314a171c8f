"""Prints the tables of docs/performance.md: over ROS, in process, shared channel, chips, growth."""

from __future__ import annotations

import argparse
import contextlib
import math
import os
import platform
import signal
import socket
import statistics
import subprocess
import sys
import tempfile
import time
from typing import Any, Callable, Iterator, Sequence

import psutil
from growth import SPACING_M

from drone_mesh.communication.seals.keys import MeshKey
from drone_mesh.inprocess import Network

PHASE_S = 60.0  # simulated: six rounds of the default timing
ON_WITHIN_S, CONNECTED_WITHIN_S = 180.0, 120.0  # wall
SETTLE_S = 5.0  # wall: the start costs more than later seconds
# drones/spacing, and the real-time factor (0: as fast as possible)
FLEETS = ((17, 6.0, 1.0), (100, 6.0, 1.0), (254, 6.0, 1.0), (254, 1.0, 1.0), (17, 6.0, 0.0))


def row(*cells: object) -> None:
    """Print a row of a Markdown table."""
    print("| " + " | ".join(str(cell) for cell in cells) + " |", flush=True)


def head(title: str, *columns: str) -> None:
    """Print the head of a table."""
    print(f"\n**{title}**\n")
    row(*columns)
    row(*("---" for _ in columns))


def say(words: str) -> None:
    """Progress, on standard error."""
    print(words, file=sys.stderr, flush=True)


def gridsize(drones: int) -> int:
    """Routers in a row of a square grid."""
    return max(1, math.ceil(math.sqrt(drones - 1)))


# Without ROS ------------------------------------------------------------------------------------


def pace(network: Network, seconds: float) -> tuple[float, float]:
    """Simulated seconds, and packets delivered, per second of processor time."""
    delivered, begun_s = network.air.delivered, time.process_time()
    network.run_for(seconds)
    used_s = time.process_time() - begun_s
    return seconds / used_s, (network.air.delivered - delivered) / used_s


def grid(drones: int, seed: int, **how: Any) -> Network:
    """A gateway and routers on a square grid."""
    network = Network(seed, **how)
    network.add_fleet(1, drones - 1, gridsize(drones), SPACING_M)
    return network


def ideal(runs: int) -> None:
    """Speed on the ideal disc, without and with a key: medians."""
    columns = ("nodes", "key", "from the start", "after", "packets", "all connected")
    head("In process: simulated s and packets per s of processor time", *columns)
    for drones in (25, 100, 254):
        for key in (None, MeshKey(bytes(range(16)))):
            starting, after, packets, connected = [], [], [], True
            for seed in range(runs):
                say(f"in process: {drones} nodes, run {seed + 1} of {runs}")
                network = grid(drones, seed, key=key)
                starting.append(pace(network, PHASE_S)[0])
                speed, rate = pace(network, PHASE_S)
                after.append(speed)
                packets.append(rate)
                connected = connected and network.all_connected()
            medians = [f"{statistics.median(values):.0f}" for values in (starting, after, packets)]
            row(drones, "with" if key else "without", *medians, "yes" if connected else "no")


def queued(radio: str, sizes: Sequence[int], runs: int) -> None:
    """Time until all are connected, and speed, on radios that share a channel."""
    columns = ("nodes", "all connected after (s)", "simulated s per core second")
    head(f"radio: {radio}, 250 kbit/s, medians of {runs}", *columns)
    for drones in sizes:
        connected_s, speeds = [], []
        for seed in range(runs):
            say(f"{radio}: {drones} nodes, run {seed + 1} of {runs}")
            network = grid(drones, seed, radio=radio, rate="250k")
            found = network.run_until(network.all_connected, 300.0)
            connected_s.append(network.now_s() if found else math.inf)
            speeds.append(pace(network, PHASE_S)[0])
            network.stop()
        row(drones, f"{statistics.median(connected_s):.1f}", f"{statistics.median(speeds):.1f}")


# Over ROS ---------------------------------------------------------------------------------------


class Watch:
    """What this program hears of the fleet. rospy's threads replace the fields; all are numbers."""

    def __init__(self) -> None:
        self.on = self.connected = self.messages = self.links = 0
        self.sim_s = 0.0
        self.delivered: float | None = None  # of all processes that report it
        self._state: Any = None

    def follow(self) -> None:
        """Subscribe to the state, which costs the fleet time, and to the figures."""
        import rospy
        from diagnostic_msgs.msg import DiagnosticArray

        from drone_mesh.msg import MeshState

        self._state = rospy.Subscriber("/mesh/state", MeshState, self._see)
        rospy.Subscriber("/diagnostics", DiagnosticArray, self._figures)

    def rest(self) -> None:
        """No more states, while the cost is measured."""
        self._state.unregister()

    def next_state(self) -> None:
        """Wait for a state that is published from now on: the second one."""
        for _ in range(2):
            before_s = self.sim_s
            wait(lambda before_s=before_s: self.sim_s > before_s, 20.0, "no /mesh/state")  # type: ignore[misc]

    def _see(self, mesh: Any) -> None:
        on = [node for node in mesh.nodes if node.on]
        self.messages = sum(node.total_messages for node in mesh.nodes)
        self.links = sum(len(node.neighbours) for node in on) // 2
        self.on, self.connected = len(on), sum(node.connected for node in on)
        self.sim_s = mesh.header.stamp.to_sec()

    def _figures(self, array: Any) -> None:
        for status in array.status:
            for pair in status.values:
                if status.name.endswith("air") and pair.key == "delivered":
                    self.delivered = float(pair.value)


def wait(there: Callable[[], bool], within_s: float, complaint: str) -> None:
    """Until `there` holds; ends the program with the complaint if that takes too long."""
    until_s = time.monotonic() + within_s
    while not there():
        if time.monotonic() > until_s:
            sys.exit(f"bench: {complaint} after {within_s:g} s")
        time.sleep(0.05)


@contextlib.contextmanager
def running(*command: str) -> Iterator[psutil.Process]:
    """A program in its own session, so that Ctrl-C in the terminal reaches only this one."""
    with tempfile.TemporaryFile() as log:
        started = subprocess.Popen(command, stdout=log, stderr=log, start_new_session=True)
        family = psutil.Process(started.pid)
        try:
            yield family
        finally:
            left = [family, *family.children(recursive=True)] if family.is_running() else []
            started.send_signal(signal.SIGINT)
            _gone, alive = psutil.wait_procs(left, timeout=30.0)
            for process in alive:
                process.kill()
            started.wait()


def cost(of: psutil.Process) -> tuple[float, float]:
    """Processor seconds so far, and memory in MB (shared pages divided), with its children."""
    cpu_s = memory = 0.0
    for process in (of, *of.children(recursive=True)):
        with contextlib.suppress(psutil.NoSuchProcess):
            times = process.cpu_times()
            cpu_s += times.user + times.system
            memory += process.memory_full_info().pss / 1e6
    return cpu_s, memory


def over_ros(fleets: Sequence[tuple[int, float, float]], seconds: float, extra: list[str]) -> None:
    """One line for each fleet that factory.launch starts."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    os.environ.update(ROS_MASTER_URI=f"http://127.0.0.1:{port}", ROS_IP="127.0.0.1")
    os.environ.pop("ROS_HOSTNAME", None)
    import rosgraph
    import rospy

    columns = ("drones", "spacing", "speed", "all on (wall s)", "connected (wall s)", "messages/s")
    more = ("deliveries/s", "links", "factor reached", "cores", "ms per s and link", "PSS (MB)")
    with running("roscore", "-p", str(port)):
        wait(rosgraph.is_master_online, 30.0, "no ROS master")
        rospy.init_node("bench", disable_signals=True)  # before the fleet: on wall time
        head("Over ROS", *columns, *more)
        for drones, spacing, factor in fleets:
            say(f"over ROS: {drones} drones, {spacing:g} m apart, real-time factor {factor:g}")
            command = [
                *("roslaunch", "drone_mesh", "factory.launch", f"routers:={drones - 1}"),
                *(f"gridsize:={gridsize(drones)}", f"spacing:={spacing:g}"),
                *(f"real_time_factor:={factor:g}", *extra),
            ]
            begun_s = time.monotonic()
            with running(*command) as fleet:
                row(
                    drones,
                    f"{spacing:g} m",
                    f"{factor:g}",
                    *measured(fleet, drones, begun_s, seconds),
                )


def measured(fleet: psutil.Process, drones: int, begun_s: float, seconds: float) -> Iterator[str]:
    """The cells of one fleet: its start, then `seconds` of wall time."""
    watch = Watch()
    watch.follow()
    wait(lambda: watch.on == drones, ON_WITHIN_S, f"only {watch.on} of {drones} nodes are on")
    on_s = time.monotonic()
    wait(lambda: watch.connected == drones, CONNECTED_WITHIN_S, "not all nodes are connected")
    connected_s = time.monotonic()
    time.sleep(SETTLE_S)
    watch.next_state()
    before, wall_s, sim_s = cost(fleet), time.monotonic(), watch.sim_s
    messages, delivered = watch.messages, watch.delivered
    watch.rest()
    time.sleep(seconds)
    after, passed_s = cost(fleet), time.monotonic() - wall_s
    heard = None if delivered is None or watch.delivered is None else watch.delivered - delivered
    watch.follow()
    watch.next_state()
    passed_sim_s, links = watch.sim_s - sim_s, watch.links
    passed_state_s = time.monotonic() - wall_s
    cores = (after[0] - before[0]) / passed_s
    factor = passed_sim_s / passed_state_s
    yield f"{on_s - begun_s:.1f}"
    yield f"{connected_s - on_s:.1f}"
    yield f"{(watch.messages - messages) / passed_state_s:.0f}"
    yield "" if heard is None else f"{heard / passed_s:.0f}"
    yield f"{links}"
    yield f"{factor:.2f}"
    yield f"{cores:.2f}"
    yield f"{1000.0 * cores / factor / links:.2f}" if links else ""
    yield f"{after[1]:.0f}"
    watch.rest()


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(prog="scripts/bench", description=__doc__)
    parser.add_argument(
        "what",
        nargs="?",
        choices=("ros", "inprocess", "shared", "chips", "growth"),
        help="measure only this; default: all but growth, which also draws a picture",
    )
    parser.add_argument("--quick", action="store_true", help="fewer sizes and runs: two minutes")
    parser.add_argument("--seconds", type=float, default=20.0, help="each fleet over ROS (20)")
    parser.add_argument(
        "--launch", nargs="+", default=[], metavar="NAME:=VALUE", help="more for factory.launch"
    )
    options = parser.parse_args()
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    runs, what, quick = 1 if options.quick else 5, options.what, options.quick
    python, load = platform.python_version(), os.getloadavg()[0]
    print(f"Measured with Python {python} on {os.cpu_count()} cores, with a load of {load:.1f}.")
    try:
        if what in (None, "ros"):
            over_ros(FLEETS[::2] if quick else FLEETS, options.seconds, options.launch)
        if what in (None, "inprocess"):
            ideal(runs)
        if what in (None, "shared"):
            queued("shared", (26, 50) if quick else (26, 50, 101), runs)
        if what in (None, "chips"):
            queued("chips", (9,) if quick else (9, 17, 26), 1)
        if what == "growth":
            from growth import SIZES, growth

            growth(SIZES[1:4] if quick else SIZES)
    except KeyboardInterrupt:
        sys.exit("bench: interrupted; the rows above are complete")


if __name__ == "__main__":
    main()
