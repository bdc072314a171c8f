"""A node reports its status in its log, over HTTP and to systemd; and it stops at once."""

from __future__ import annotations

import contextlib
import http.server
import json
import random
import re
import socket
import threading
import time
from pathlib import Path
from typing import Iterator

import httpx
import pytest
from patience import free_port, wait_for

from drone_mesh.drone.engines import GroundEngine
from drone_mesh.internet.http_settings import HttpSettings
from drone_mesh.internet.on_demand import http_internet
from drone_mesh.nrf24.emulator.chip_core import State
from drone_mesh.raspberry.emulated_air import EmulatedAir
from drone_mesh.raspberry.node import RadioNode
from drone_mesh.raspberry.node_reports import one_line, table
from drone_mesh.raspberry.options import parse_gateway
from drone_mesh.raspberry.program import without_internet
from drone_mesh.raspberry.service_manager import ServiceManager
from drone_mesh.raspberry.status_command import main

pytestmark = pytest.mark.slow


class Field:
    """A gateway and routers on one emulated air."""

    def __init__(self, nodes: int, make_internet=without_internet) -> None:
        options = parse_gateway(["--emulated", str(nodes), "--check-period", "2"], {})
        self.air = EmulatedAir(options.radio, nodes)
        self.nodes = [
            RadioNode(
                self.air.radio(node_id, options.radio),
                GroundEngine(node_id, self.air.place(node_id)),
                options,
                None if node_id else make_internet,
            )
            for node_id in range(nodes)
        ]
        self.running = list(self.nodes)
        for node in self.nodes:
            node.start()

    def stop(self, *nodes: RadioNode) -> None:
        for node in nodes:
            self.running.remove(node)
            node.stop()

    def chip_state(self, node_id: int) -> State:
        return self.air._chips[node_id].state

    def close(self) -> None:
        self.stop(*list(self.running))
        self.air.close()


@contextlib.contextmanager
def field(nodes: int, **settings) -> Iterator[Field]:
    made = Field(nodes, **settings)
    try:
        yield made
    finally:
        made.close()


def test_the_status_over_http_names_neighbours_radio_flight_and_version(capsys):
    port = free_port()

    def internet(node):
        return http_internet(
            node.submit, HttpSettings(port=port), status=node.status, mesh=node.mesh
        )

    with field(3, make_internet=internet) as mesh:
        wait_for(
            "all are connected",
            lambda: all(n.component.get_connected_to_gateway() for n in mesh.nodes),
        )
        wait_for("it has neighbours", lambda: len(mesh.nodes[0].status()["neighbours"]) == 2)
        wait_for(
            "it has sent packets to both",
            lambda: all(n["tries_per_packet"] for n in mesh.nodes[0].status()["neighbours"]),
        )
        status = httpx.get(f"http://127.0.0.1:{port}/status", verify=False).json()
        assert main([f"http://127.0.0.1:{port}"]) == 0
        whole = httpx.get(f"http://127.0.0.1:{port}/mesh?after=1", verify=False).json()
    assert [(node["id"], node["role"]) for node in whole["nodes"]] == [
        (0, "gateway"),
        (1, "router"),
        (2, "router"),
    ]
    assert all(node["connected"] for node in whole["nodes"])
    assert whole["events"][0]["number"] == 2
    assert {"node": 0, "kind": "neighbour found", "peers": [1]}.items() <= next(
        event.items() for event in whole["events"] if event["peers"] == [1] and event["node"] == 0
    )
    assert status["node"] == 0
    assert status["connected"] is True
    assert (status["gateway"], status["hops"]) == (0, 0)
    assert [neighbour["id"] for neighbour in status["neighbours"]] == [1, 2]
    assert all(neighbour["heard_s_ago"] < 20.0 for neighbour in status["neighbours"])
    for neighbour in status["neighbours"]:
        assert neighbour["tries_per_packet"] >= 1.0
        assert 0.0 <= neighbour["delivered"] <= 1.0
    assert re.search(r"\n1 +[\d.]+ s ago +[\d.]+ +\d+%\n2 ", table(status))
    assert status["flight"]["why_not"] == "it stands on the ground"
    assert status["flight"]["latitude_longitude_height"] == [0.0, 0.0, 0.0]
    assert status["radio"]["received"] > 0
    assert status["radio"]["tries_per_packet"] >= 1.0
    assert "radio: received" in capsys.readouterr().out
    line = one_line(status)
    assert line.startswith("gateway 0, 0 hops; neighbours 1 2; sent ")
    assert line.endswith("drone: it stands on the ground")
    assert re.search(r"flight: why not +it stands on the ground\n", table(status))
    json.dumps(status)  # nothing but JSON values


def test_an_unavailable_status_gives_one_line_and_a_failure(capsys):
    assert main([f"http://127.0.0.1:{free_port()}"]) == 1
    assert capsys.readouterr().err.endswith(": Connection refused\n")


def test_an_address_without_its_scheme_is_refused(capsys):
    with pytest.raises(SystemExit):
        main(["pi:9080"])
    assert "pi:9080: must begin with http:// or https://" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("code", "page", "said"),
    [
        (404, b"<html>", "HTTP Error 404"),
        (200, b"[1]", "not from a mesh node"),
        (200, b"<", "line 1"),
    ],
)
def test_a_server_that_is_not_a_node_gives_one_line(code, page, said, capsys):
    class Other(http.server.BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            self.send_response(code)
            self.end_headers()
            self.wfile.write(page)

    with http.server.HTTPServer(("127.0.0.1", 0), Other) as server:
        answering = threading.Thread(target=server.handle_request)
        answering.start()
        assert main([f"http://127.0.0.1:{server.server_port}"]) == 1
        answering.join()
    assert said in capsys.readouterr().err.splitlines()[-1]


def test_a_node_whose_thread_hangs_is_not_alive(monkeypatch):
    monkeypatch.setattr("drone_mesh.raspberry.node.ALIVE_WITHIN_S", 1.0)
    with field(2) as mesh:
        node = mesh.nodes[1]
        wait_for("it is alive", node.is_alive)
        hung = time.monotonic() + 3.0
        node._slot.submit(lambda _now_s: time.sleep(max(0.0, hung - time.monotonic())))
        wait_for("it is noticed", lambda: not node.is_alive())
        wait_for("it is alive again", node.is_alive)


def test_systemd_is_notified_when_it_is_ready_alive_and_stopping(tmp_path: Path):
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as systemd:
        systemd.bind(str(tmp_path / "notify"))
        systemd.settimeout(10.0)
        manager = ServiceManager({"NOTIFY_SOCKET": str(tmp_path / "notify")})
        manager.ready()
        manager.alive("all is well")
        manager.stopping()
        said = [systemd.recv(200) for _ in range(3)]
    assert said == [b"READY=1", b"WATCHDOG=1\nSTATUS=all is well", b"STOPPING=1"]


def test_without_a_service_manager_and_with_one_that_is_gone_nothing_happens(tmp_path: Path):
    ServiceManager({}).ready()
    ServiceManager({"NOTIFY_SOCKET": str(tmp_path / "gone")}).alive("no reader")


def worst_stop_s(seed: int) -> tuple[float, State]:
    """Stop a gateway after its neighbours left and while it has packets for them; how long."""
    rng = random.Random(seed)
    with field(4) as mesh:
        gateway = mesh.nodes[0]
        wait_for("it has neighbours", lambda: len(gateway.component.get_neighbours()) >= 2)
        mesh.stop(*mesh.nodes[1:])
        for node in (1, 2, 3):
            gateway._slot.submit(lambda _now_s, node=node: gateway.component.send_heartbeat(node))
        gateway._slot.submit(lambda _now_s: gateway.component.control.routes.maintain_routing())
        time.sleep(rng.uniform(0.0, 0.5))
        started_s = time.monotonic()
        mesh.stop(gateway)
        return time.monotonic() - started_s, mesh.chip_state(0)


@pytest.mark.parametrize("seed", range(3))
def test_a_gateway_whose_neighbours_are_gone_stops_with_its_radio_powered_down(seed):
    _seconds, state = worst_stop_s(seed)
    assert state is State.POWER_DOWN
