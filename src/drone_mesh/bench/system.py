"""Starts and stops the measured system: master, probe and fleet."""

from __future__ import annotations

import contextlib
import os
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path
from typing import Callable, Iterable, Sequence

import psutil

from drone_mesh.bench.cases import Case
from drone_mesh.bench.observation import PROBE, WATCH, StateSample, Watch, from_line
from drone_mesh.bench.processes import Use, family, take_use
from drone_mesh.bench.progress import ProgressLine
from drone_mesh.errors import MeshError
from drone_mesh.stopping import ignored
from drone_mesh.web import LOOPBACK

PART_WITHIN_S = 30.0  # wall; our choice, for master and probe
ON_WITHIN_S = 180.0  # wall; our choice: six times the allowed time for 254 drones
CONNECTED_WITHIN_S = 120.0  # wall; the same limit as for the original
END_WITHIN_S = 20.0  # wall; roslaunch itself waits 15 s before it kills a node
LOG_LINES_SHOWN = 15
POLL_PERIOD_S = 0.05  # wall
MASTER, THE_PROBE, FLEET = "roscore", "probe", "factory.launch"  # the parts, as their logs


class BenchmarkError(MeshError):
    """The system could not be started or measured. The message gives cause and remedy."""


def check_environment() -> None:
    """Raise BenchmarkError unless ROS and the built package are available."""
    if shutil.which("roslaunch") is None or shutil.which("rospack") is None:
        raise BenchmarkError(
            "ROS not found: source the setup.bash of the workspace first (or scripts/env.bash), "
            "or measure without ROS: --only inprocess"
        )
    if _fails("rospack", "find", "drone_mesh"):
        raise BenchmarkError(
            "ROS does not find the package drone_mesh: build it, then source devel/setup.bash "
            "(scripts/bench does both)"
        )
    if _fails(sys.executable, "-c", "import drone_mesh.msg"):
        raise BenchmarkError(
            "the messages of drone_mesh are not built for this Python: build the package, then "
            "source devel/setup.bash (scripts/bench does both)"
        )


def _fails(*command: str) -> bool:
    return subprocess.run(command, capture_output=True).returncode != 0


def free_port() -> int:
    """A free TCP port of the loopback interface."""
    with socket.socket() as probe:
        probe.bind((LOOPBACK, 0))
        port: int = probe.getsockname()[1]
        return port


class System:
    """One master, one probe, one fleet. A context manager, which always stops all three.

    A thread reads the lines of the probe and owns the watch; others only read it.
    """

    def __init__(
        self, case: Case, launch_args: Sequence[str], port: int, progress: ProgressLine
    ) -> None:
        """`launch_args`: further ones for roslaunch drone_mesh factory.launch."""
        self.case = case
        self.progress = progress
        self.watch = Watch(case.drones)
        self.launched_s = 0.0  # time.monotonic
        self._launch_args = [*case.launch_args(), *launch_args]
        self._port = port
        self._logs = Path(tempfile.mkdtemp(prefix="drone_mesh_bench_"))
        self._environment = {
            **os.environ,
            "ROS_MASTER_URI": f"http://{LOOPBACK}:{port}",
            "ROS_IP": LOOPBACK,
            "ROS_LOG_DIR": str(self._logs),
        }
        self._environment.pop("ROS_HOSTNAME", None)
        self._parts: dict[str, subprocess.Popen[bytes]] = {}
        self._reader: threading.Thread | None = None
        self._seen: dict[int, psutil.Process] = {}

    def __enter__(self) -> System:
        """Start everything; returns as soon as all nodes are on.

        Raises BenchmarkError after a time limit.
        """
        try:
            if self._master_answers():
                raise BenchmarkError(f"port {self._port} is taken: use another one")
            self._start(MASTER, ["roscore", "-p", str(self._port)])
            self._await("ROS master", self._master_answers)
            command = [sys.executable, "-m", "drone_mesh.ros.views.bench_probe"]
            probe = self._start(THE_PROBE, command, piped=True)
            self._reader = threading.Thread(target=self._read, args=(probe,), daemon=True)
            self._reader.start()
            self.order(WATCH)
            # Before the fleet: nodes that start after it use simulated time.
            self._await("probe", lambda: PROBE in self.watch.figures)
            self.launched_s = time.monotonic()
            self._start(FLEET, ["roslaunch", "drone_mesh", "factory.launch", *self._launch_args])
            self._await_nodes()
        except BaseException:
            self.close()
            raise
        return self

    def __exit__(self, *_error: object) -> None:
        self.close()
        self.progress.clear()

    def _await_nodes(self) -> None:
        watch = self.watch

        def on() -> str:
            return f"{watch.last.on if watch.last else 0} of {self.case.drones} nodes"

        def words() -> str:
            return f"{on()} on, {time.monotonic() - self.launched_s:.0f} s"

        if not self.wait_for(lambda: watch.all_on is not None, ON_WITHIN_S, words):
            raise BenchmarkError(f"only {on()} are on after {ON_WITHIN_S:g} s")

    def await_connected(self) -> bool:
        """Whether all routers are connected within a time limit."""
        watch = self.watch

        def words() -> str:
            connected = watch.last.connected if watch.last else 0
            return f"{connected} of {self.case.routers} routers connected"

        found = self.wait_for(lambda: watch.all_connected is not None, CONNECTED_WITHIN_S, words)
        if watch.all_on and watch.all_connected:
            after_s = watch.all_connected.wall_s - watch.all_on.wall_s
            self.progress.say(f"all connected after {after_s:.1f} s")
        return found

    def order(self, order: str) -> None:
        """Order the probe to start or stop watching the state, or to start the flights."""
        orders = self._parts[THE_PROBE].stdin
        assert orders is not None
        with contextlib.suppress(BrokenPipeError):  # check() reports it
            orders.write(f"{order}\n".encode())
            orders.flush()

    def check(self) -> None:
        """Raise BenchmarkError, with the end of its log, if a part of the system has ended."""
        for name, process in self._parts.items():
            if process.poll() is not None:
                raise BenchmarkError(
                    f"{name} exited with code {process.returncode}:\n{self._log_of(name)}"
                )

    def wait_for(
        self,
        condition: Callable[[], bool],
        within_s: float,
        words: Callable[[], str] | None = None,
    ) -> bool:
        """True as soon as `condition` holds; False after `within_s` wall seconds without it.

        `words`: the progress to show meanwhile. Raises BenchmarkError if a part of the system ends
        before.
        """
        deadline_s = time.monotonic() + within_s
        while not condition():
            if time.monotonic() > deadline_s:
                return False
            self.check()
            if words is not None:
                self.progress.say(words())
            time.sleep(POLL_PERIOD_S)
        return True

    def wait_until_s(
        self, sim_s: float, within_s: float, words: Callable[[], str], complaint: str
    ) -> StateSample:
        """The first state from this simulated second on.

        Raises BenchmarkError with the complaint if it does not come within so much wall time.
        """
        watch = self.watch

        def is_there() -> bool:
            return watch.last is not None and watch.last.sim_s >= sim_s

        if not self.wait_for(is_there, within_s, words) or watch.last is None:
            raise BenchmarkError(f"{complaint} takes more than {within_s:g} s")
        return watch.last

    def use(self) -> Use:
        """The cost of fleet and master so far, without the probe."""
        processes = [*family(self._parts[MASTER].pid), *family(self._parts[FLEET].pid)]
        self._seen.update((process.pid, process) for process in processes)
        return take_use(processes, time.monotonic())

    def close(self) -> None:
        """Stop everything that was started, the fleet first. A second call changes nothing.

        Signals are ignored meanwhile; otherwise processes could be left behind.
        """
        with ignored(signal.SIGINT, signal.SIGTERM):
            self._close()

    def _close(self) -> None:
        latest_first = [*self._parts.values()][::-1]
        for started in latest_first:
            self._seen.update((process.pid, process) for process in family(started.pid))
            if started.stdin is not None:
                with contextlib.suppress(BrokenPipeError):
                    started.stdin.close()
        for started in latest_first:
            _end(started)
        _end_remaining(self._seen.values())
        if self._reader is not None:
            self._reader.join()
            self._reader = None
        self._parts.clear()
        self._seen.clear()
        shutil.rmtree(self._logs, ignore_errors=True)

    def _start(
        self, name: str, command: Sequence[str], piped: bool = False
    ) -> subprocess.Popen[bytes]:
        """Start a process in its own session, so that Ctrl-C in the terminal reaches only us."""
        with self._log_path(name).open("wb") as log:
            self._parts[name] = started = subprocess.Popen(
                command,
                env=self._environment,
                stdin=subprocess.PIPE if piped else subprocess.DEVNULL,
                stdout=subprocess.PIPE if piped else log,
                stderr=log,
                start_new_session=True,
            )
        return started

    def _await(self, what: str, there: Callable[[], bool]) -> None:
        if not self.wait_for(there, PART_WITHIN_S):
            raise BenchmarkError(f"no {what} after {PART_WITHIN_S:g} s")

    def _master_answers(self) -> bool:
        with socket.socket() as connection:
            connection.settimeout(1.0)
            return connection.connect_ex((LOOPBACK, self._port)) == 0

    def _read(self, probe: subprocess.Popen[bytes]) -> None:
        assert probe.stdout is not None
        for line in probe.stdout:
            with contextlib.suppress(ValueError):  # the last line may be incomplete
                self.watch.see(from_line(line.decode()))
        probe.stdout.close()

    def _log_path(self, name: str) -> Path:
        return self._logs / f"{name}.out"

    def _log_of(self, name: str) -> str:
        text = self._log_path(name).read_text(encoding="utf-8", errors="replace")
        return "\n".join(text.splitlines()[-LOG_LINES_SHOWN:])


def _end(started: subprocess.Popen[bytes]) -> None:
    """Send SIGINT, then stronger signals."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGKILL):
        if started.poll() is not None:
            break
        started.send_signal(number)
        with contextlib.suppress(subprocess.TimeoutExpired):
            started.wait(END_WITHIN_S)
    started.wait()


def _end_remaining(processes: Iterable[psutil.Process]) -> None:
    remaining = [process for process in processes if process.is_running()]
    for process in remaining:
        with contextlib.suppress(psutil.NoSuchProcess):
            process.terminate()
    _gone, alive = psutil.wait_procs(remaining, timeout=2.0)
    for process in alive:
        with contextlib.suppress(psutil.NoSuchProcess):
            process.kill()
