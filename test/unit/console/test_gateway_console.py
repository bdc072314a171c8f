"""The console of a real mesh: what it asks of the gateway, and what it does with the answers."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import threading
from http.server import BaseHTTPRequestHandler, HTTPServer

import pytest

from drone_mesh.console.controls import OrderRefused
from drone_mesh.console.frame_store import FrameStore
from drone_mesh.console.gateway_client import GatewayClient, GatewayControls, origin_of
from drone_mesh.console.gateway_command import GatewayFeed, main
from drone_mesh.console.history import History
from drone_mesh.console.memory import ConsoleMemory
from drone_mesh.drone.geodesy import Origin
from drone_mesh.errors import ConfigurationError
from drone_mesh.web.json_client import NoAnswer

NODE = {
    "id": 0,
    "role": "gateway",
    "on": True,
    "connected": True,
    "hops": 0,
    "next_hop": 0,
    "heard_s_ago": 0.0,
    "reported": True,
    "neighbours": [],
    "battery_percent": None,
    "flying": False,
    "why_not_fly": "",
    "place": [1.0, 2.0, 0.0],
    "earth": [52.0, 5.0, 3.0],
}
EVENT = {"number": 7, "t": 1.5, "node": 0, "kind": "started", "peers": [], "detail": ""}
MESH = {"gateway": 0, "run": "a1b2", "uptime_s": 60.0, "nodes": [NODE], "events": [EVENT]}


class Gateway(HTTPServer):
    """Answers with what the test says, and keeps the requests."""

    def __init__(self):
        self.requests = []
        self.status, self.answer = 200, MESH
        super().__init__(("127.0.0.1", 0), Handler)
        self.url = f"http://127.0.0.1:{self.server_port}"


class Handler(BaseHTTPRequestHandler):
    server: Gateway

    def do_GET(self):
        length = int(self.headers.get("Content-Length", 0))
        body = self.rfile.read(length).decode()
        sender = self.headers.get("Authorization", "")
        self.server.requests.append((self.command, self.path, body, sender))
        text = json.dumps(self.server.answer).encode()
        self.send_response(self.server.status)
        self.send_header("Content-Length", str(len(text)))
        self.end_headers()
        self.wfile.write(text)

    do_POST = do_GET

    def log_message(self, *_arguments):
        pass


@pytest.fixture
def gateway():
    server = Gateway()
    thread = threading.Thread(target=server.serve_forever, args=(0.01,))
    thread.start()
    yield server
    server.shutdown()
    thread.join()
    server.server_close()


class PromptRunner:
    """Does at once what is for the loop."""

    def in_loop(self, function):
        function()


def feed_of(gateway_url, store, path=None, token=""):
    memory = ConsoleMemory(store, path)
    return GatewayFeed(GatewayClient(gateway_url, token), store, PromptRunner(), memory)


def frame(store):
    return json.loads(store.frame_since(0))


def test_each_request_asks_for_the_events_after_the_last_one(gateway):
    store = FrameStore(History())
    feed = feed_of(gateway.url, store, token="secret")
    feed.ask()
    feed.ask()
    assert gateway.requests == [
        ("GET", "/mesh?after=0", "", "Bearer secret"),
        ("GET", "/mesh?after=7", "", "Bearer secret"),
    ]
    shown = frame(store)
    assert shown["nodes"]["0"]["earth"] == [52.0, 5.0, 3.0]
    assert shown["nodes"]["0"]["position"] == [2.0, 1.0, 0.0]
    assert shown["events"][0]["kind"] == "started"
    assert shown["link"] == ""


def test_the_battery_and_the_reason_not_to_fly_are_fields_and_a_trouble(gateway):
    drone = {
        **NODE,
        "id": 4,
        "role": "router",
        "hops": 1,
        "battery_percent": 4,
        "why_not_fly": "battery at 4 %, below --min-battery 30",
        "tries": 1.5,
    }
    gateway.answer = {**MESH, "nodes": [NODE, drone]}
    store = FrameStore(History())
    feed_of(gateway.url, store).ask()
    shown = frame(store)["nodes"]["4"]
    assert (shown["battery"], shown["channel"]) == (4, "1.5 tries per packet")
    assert shown["why_not_fly"] == "battery at 4 %, below --min-battery 30"
    assert (shown["trouble"], shown["severity"]) == (f"cannot fly: {shown['why_not_fly']}", 1)
    assert frame(store)["nodes"]["0"]["battery"] is None


def test_a_gateway_that_was_restarted_is_asked_from_the_start(gateway):
    feed = feed_of(gateway.url, FrameStore(History()))
    feed.ask()
    gateway.answer = {**MESH, "uptime_s": 3.0, "events": []}
    feed.ask()
    feed.ask()
    assert [path for _, path, _, _ in gateway.requests] == [
        "/mesh?after=0",
        "/mesh?after=7",
        "/mesh?after=0",
    ]


def test_a_console_that_was_restarted_goes_on_where_it_was(gateway, tmp_path):
    path = tmp_path / "console.sqlite"
    before = feed_of(gateway.url, FrameStore(History()), path)
    before.ask()
    gateway.answer = {**MESH, "uptime_s": 70.0, "events": [EVENT, {**EVENT, "number": 8}]}
    store = FrameStore(History())
    feed = feed_of(gateway.url, store, path)
    feed.ask()
    assert len(frame(store)["events"]) == 2  # what happened while it was away, once
    assert store.history.times == [60.0, 70.0]
    feed.ask()
    assert gateway.requests[-1][1] == "/mesh?after=8"


def test_of_a_gateway_that_was_restarted_meanwhile_nothing_old_is_shown(gateway, tmp_path):
    path = tmp_path / "console.sqlite"
    feed_of(gateway.url, FrameStore(History()), path).ask()
    gateway.answer = {**MESH, "run": "c3d4", "uptime_s": 90.0, "events": []}
    store = FrameStore(History())
    feed_of(gateway.url, store, path).ask()
    assert "events" not in frame(store)
    assert store.history.times == [90.0]


@pytest.mark.parametrize(
    ("status", "answer", "said"),
    [
        (401, {"detail": "token missing"}, "token missing"),
        (200, ["no mesh"], "is not a gateway of this version"),
        (200, {**MESH, "nodes": [{}]}, "invalid answer"),
        (200, {**MESH, "gateway": None}, "invalid answer"),
    ],
)
def test_a_gateway_with_an_invalid_answer_is_named_on_the_page(gateway, status, answer, said):
    gateway.status, gateway.answer = status, answer
    store = FrameStore(History())
    feed_of(gateway.url, store).ask()
    assert said in frame(store)["link"]


def test_a_gateway_that_does_not_answer_is_named_on_the_page():
    store = FrameStore(History())
    feed_of("http://127.0.0.1:1", store).ask()
    assert frame(store)["link"].startswith("no answer from http://127.0.0.1:1")


def test_an_order_of_the_page_is_posted_and_a_refusal_comes_back(gateway):
    controls = GatewayControls(GatewayClient(gateway.url))
    assert controls.fly(3, 1.5, -2.0, 4.0) == "ordered drone 3 to x 1.5, y -2, z 4 m"
    method, path, body, _ = gateway.requests[0]
    assert (method, path) == ("POST", "/drones/3/goal")
    assert json.loads(body) == {"latitude": -2.0, "longitude": 1.5, "height": 4}
    gateway.status, gateway.answer = 503, {"detail": "no route to drone 3"}
    with pytest.raises(OrderRefused, match="no route to drone 3"):
        controls.fly(3, 0.0, 0.0, 0.0)


def test_an_order_onto_the_place_of_another_drone_says_so_to_the_gateway(gateway):
    controls = GatewayControls(GatewayClient(gateway.url))
    controls.fly(3, 1.5, -2.0, 4.0, allow_shared_place=True)
    assert gateway.requests[0][1] == "/drones/3/goal?allow_shared_place=true"


def test_orders_that_only_a_simulation_knows_are_refused():
    controls = GatewayControls(GatewayClient("http://127.0.0.1:1"))
    for refused in (
        lambda: controls.power(1, True),
        lambda: controls.layout(0),
        lambda: controls.speed(True, 1.0),
    ):
        with pytest.raises(OrderRefused):
            refused()


def test_an_error_page_without_a_reason_is_named_by_its_status(gateway):
    gateway.status, gateway.answer = 500, "oops"
    with pytest.raises(NoAnswer, match="500"):
        GatewayClient(gateway.url).mesh(0)


def test_an_invalid_address_ends_the_program_with_a_reason(capsys):
    with pytest.raises(SystemExit):
        main(["--gateway", "pi:9080"], {})
    assert "must begin with http:// or https://" in capsys.readouterr().err


@pytest.mark.slow
def test_a_package_that_is_missing_is_named_in_one_line():
    program = (
        "import sys; sys.modules['uvicorn'] = None; "
        "from drone_mesh.console.__main__ import main; sys.exit(main())"
    )
    done = subprocess.run(
        [sys.executable, "-c", program],
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 1
    assert done.stderr == (
        "drone_mesh_console needs the Python package uvicorn: pip install 'drone_mesh[console]'\n"
    )


def test_the_origin_is_the_gateways():
    assert origin_of({**MESH, "origin": [52.0907, 5.1214, 3.0]}) == Origin(52.0907, 5.1214, 3.0)
    assert origin_of({**MESH, "origin": None}) is None
    assert origin_of(MESH) is None  # an older gateway
    with pytest.raises(ConfigurationError):
        origin_of({**MESH, "origin": [152, 5, 3]})
