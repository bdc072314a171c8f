"""The two programs as processes of their own: without hardware, and emulated."""

from __future__ import annotations

import contextlib
import importlib.util
import os
import queue
import re
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import httpx
import pytest
from patience import PATIENCE_S, free_port, wait_for

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[3]
END_WITHIN_S = 5.0
TOKEN = "0123456789abcdef"
NO_SPI = (
    "/dev/spidev99.0 does not exist: switch SPI on"
    if importlib.util.find_spec("spidev")
    else "cannot use /dev/spidev99.0: the Python package spidev is missing (sudo apt install"
)


class Program:
    """A running program and its output."""

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
        """The first line that matches; fails with the whole output until then."""
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
def test_what_is_missing_is_reported_in_one_line_with_what_to_do(name, line, reason):
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
        airtimes = re.findall(r"airtime_s (\S+),", program.said)
        assert len(airtimes) == 5
        assert all(len(airtime) <= len("12.345") for airtime in airtimes)
        assert re.search(r"wrote \d+ frames to ", program.said)
        assert trace.read_bytes().startswith(bytes.fromhex("0a0d0d0a"))  # pcapng


def test_a_second_program_with_the_same_nodes_reports_it_in_one_line():
    lines = [f"--emulated 3 --port {free_port()}".split() for _ in range(2)]
    with Program("raspberry_gateway", *lines[0]) as first:
        first.wait_for("node 2: started")
        with Program("raspberry_gateway", *lines[1]) as second:
            second.wait_for(
                "cannot reach nodes 0..2: .*node-0.sock: another program already runs a node"
            )
            second.wait_for("node 2: started")
            assert second.end(signal.SIGTERM)[0] == 0
            assert second.said.count("mesh_ping") == 1
        first.end(signal.SIGTERM)


def test_an_emulated_gateway_sends_an_order_over_several_hops_and_ends_on_sigterm():
    port = free_port()
    line = f"--emulated 4 --port {port} --check-period 2"
    with Program("raspberry_gateway", *line.split()) as program, httpx.Client(
        base_url=f"http://127.0.0.1:{port}", headers={"Authorization": f"Bearer {TOKEN}"}
    ) as client:
        program.wait_for("all 4 nodes are connected")
        assert client.get("/ready").json() == {"ready": True, "gateway": 0}
        wait_for("the gateway hears of node 3", lambda: ask_hops(client).get(3, 0) >= 2)
        wait_for(
            "the gateway finds a route to drone 3",
            lambda: client.post("/DroneMovement/3/21.5/-22.5/4").status_code == 200,
        )
        program.wait_for("node 3: order refused: drone 3 cannot fly: it stands on the ground")
        wait_for("the reply to the order", lambda: last_order(client)["state"] == "refused")
        assert last_order(client)["reason"] == "drone 3 cannot fly: it stands on the ground"
        assert client.get("/ready", headers={"Authorization": ""}).status_code == 401
        status, seconds = program.end(signal.SIGTERM)
        assert status == 0
        assert seconds < END_WITHIN_S
        assert "Traceback" not in program.said


def test_single_nodes_on_a_shared_air_can_be_killed_and_restarted():
    port, air = free_port(), free_port()
    serve = f"--emulated-air-serve {air} --port {port} --check-period 2"

    def router(node_id):
        place = f"--latitude 0 --longitude {60 * node_id}"
        line = f"--id {node_id} --emulated-air {air} --check-period 2 {place}"
        return Program("raspberry_router", *line.split())

    with Program("raspberry_gateway", *serve.split()) as gateway:
        gateway.wait_for("others join it with --emulated-air 127.0.0.1")
        gateway.wait_for("orders over HTTP")
        with router(2) as far, httpx.Client(
            base_url=f"http://127.0.0.1:{port}", headers={"Authorization": f"Bearer {TOKEN}"}
        ) as client:
            with router(1) as relay:
                gateway.wait_for("node 2 joins at x 120, y 0, z 0 m")
                wait_for("2 is connected over 1", lambda: ask_hops(client).get(2, 0) == 2)
                relay.end(signal.SIGKILL)
                gateway.wait_for("node 1 is gone")
                wait_for("the loss of node 1 is noticed", lambda: routes(client) == {})
            with router(1) as relay:
                wait_for("2 is back over 1", lambda: routes(client) == {1: 1, 2: 1})
                assert relay.end(signal.SIGTERM)[0] == 0
            assert far.end(signal.SIGTERM)[0] == 0
            assert "Traceback" not in far.said
        assert gateway.end(signal.SIGTERM)[0] == 0
        assert "Traceback" not in gateway.said


def test_an_air_that_no_process_serves_gives_one_line_with_what_to_do():
    line = f"--id 3 --emulated-air {free_port()} --log-level error"
    with Program("raspberry_router", *line.split()) as program:
        assert program.result() == 1
        assert program.said.startswith("raspberry_router: no emulated air at 127.0.0.1:")
        assert "--emulated-air-serve" in program.said


def routes(client):
    """Next hops, of the nodes that the gateway has a route to."""
    nodes = client.get("/nodes").json()["nodes"]
    return {node["id"]: node["next_hop"] for node in nodes if node["next_hop"] is not None}


def last_order(client):
    return client.get("/orders").json()["orders"][-1]


def ask_hops(client):
    return {node["id"]: node["hops"] or 0 for node in client.get("/nodes").json()["nodes"]}
