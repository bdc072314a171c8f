"""The two programs as processes of their own: without hardware, and emulated."""

from __future__ import annotations

import contextlib
import importlib.util
import os
import queue
import re
import signal
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path

import httpx
import pytest

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[3]
PATIENCE_S = 60.0  # until all are connected; on an idle machine it takes 3 s
END_WITHIN_S = 5.0
TOKEN = "0123456789abcdef"
NO_SPI = (
    "/dev/spidev99.0 does not exist: switch SPI on"
    if importlib.util.find_spec("spidev")
    else "cannot use /dev/spidev99.0: the Python package spidev is missing (sudo apt install"
)


class Program:
    """A running program and what it says."""

    def __init__(self, name, *arguments):
        self._process = subprocess.Popen(
            [sys.executable, str(ROOT / "nodes" / name), *arguments],
            env={**os.environ, "PYTHONPATH": str(ROOT / "src"), "DRONE_MESH_TOKEN": TOKEN},
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )
        self._lines = queue.Queue()
        self.said = ""
        self._reader = threading.Thread(target=self._read)
        self._reader.start()

    def _read(self):
        for line in self._process.stdout:
            self._lines.put(line)
        self._lines.put(None)

    def wait_for(self, pattern):
        """What the first line that matches says; fails with all that was said until then."""
        deadline = time.monotonic() + PATIENCE_S
        while True:
            try:
                line = self._lines.get(timeout=max(0.0, deadline - time.monotonic()))
            except queue.Empty:
                pytest.fail(f"not said within {PATIENCE_S:g} s: {pattern}; but:\n{self.said}")
            if line is None:
                pytest.fail(f"ended without {pattern}:\n{self.said}")
            self.said += line
            if found := re.search(pattern, line):
                return found

    def end(self, number):
        """Send the signal; exit status and seconds it took."""
        started_s = time.monotonic()
        self._process.send_signal(number)
        return self.result(), time.monotonic() - started_s

    def result(self):
        """The exit status, when it has ended by itself."""
        status = self._process.wait(PATIENCE_S)
        self._reader.join()
        while (line := self._lines.get()) is not None:
            self.said += line
        return status

    def __enter__(self):
        return self

    def __exit__(self, *_error):
        with contextlib.suppress(ProcessLookupError):
            self._process.kill()
        self._process.wait()
        self._reader.join()
        self._process.stdout.close()


def free_port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


@pytest.mark.parametrize(
    ("name", "line", "reason"),
    [
        ("raspberry_router", "--id 3 --spi 99.0", NO_SPI),
        (
            "raspberry_router",
            "--emulated 2 --trace /no/such/file",
            "--trace /no/such/file: No such",
        ),
        ("raspberry_gateway", "--spi 99.0", NO_SPI),
    ],
)
def test_what_is_missing_is_said_in_one_line_with_what_to_do(name, line, reason):
    with Program(name, *line.split()) as program:
        assert program.result() == 1
        assert program.said.startswith(f"{name}: {reason}")
        assert program.said.count("\n") == 1


def test_emulated_routers_connect_over_several_hops_and_end_on_ctrl_c(tmp_path):
    trace = tmp_path / "air.pcapng"
    with Program("raspberry_router", "--emulated", "5", "--trace", str(trace)) as program:
        found = program.wait_for(r"all 5 nodes are connected after .* s; hops to the gateway: (.*)")
        hops = dict(map(int, pair.split(":")) for pair in found[1].split())
        assert hops[0] == 0
        # No fewer hops than the places allow; a frame lost when they met may cost a detour.
        assert all(hops[node] >= shortest for node, shortest in ((1, 1), (2, 1), (3, 2), (4, 2)))
        status, seconds = program.end(signal.SIGINT)
        assert status == 0
        assert seconds < END_WITHIN_S
        assert "Traceback" not in program.said
        assert program.said.count("packets: sent") == 5
        assert re.search(r"wrote \d+ frames to ", program.said)
        assert trace.read_bytes().startswith(bytes.fromhex("0a0d0d0a"))  # pcapng


def test_an_emulated_gateway_sends_an_order_over_several_hops_and_ends_on_sigterm():
    port = free_port()
    line = f"--emulated 4 --port {port} --check-period 2"
    with Program("raspberry_gateway", *line.split()) as program, httpx.Client(
        base_url=f"http://127.0.0.1:{port}", headers={"Authorization": f"Bearer {TOKEN}"}
    ) as client:
        program.wait_for("all 4 nodes are connected")
        assert client.get("/ready").json() == {"ready": True, "gateway": 0}
        wait_until(lambda: ask_hops(client).get(3, 0) >= 2, "the gateway never heard of node 3")
        wait_until(
            lambda: client.post("/DroneMovement/3/1.5/-2.5/4").status_code == 200,
            "the gateway found no route to drone 3",
        )
        program.wait_for("node 3: order refused: drone 3 cannot fly: it stands on the ground")
        assert client.get("/ready", headers={"Authorization": ""}).status_code == 401
        status, seconds = program.end(signal.SIGTERM)
        assert status == 0
        assert seconds < END_WITHIN_S
        assert "Traceback" not in program.said


def ask_hops(client):
    return {node["id"]: node["hops"] or 0 for node in client.get("/nodes").json()["nodes"]}


def wait_until(condition, otherwise):
    deadline = time.monotonic() + PATIENCE_S
    while not condition():
        assert time.monotonic() < deadline, otherwise
        time.sleep(0.1)
