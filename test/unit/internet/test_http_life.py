"""Start and end of a gateway's HTTP side, a gateway that does not answer, and what stays behind."""

from __future__ import annotations

import contextlib
import gc
import http.client
import logging
import sys
import threading
from concurrent.futures import ThreadPoolExecutor

import httpx
import pytest
from patience import PATIENCE_S, wait_for

from drone_mesh.communication.interfaces import IGatewayCommands
from drone_mesh.internet.http_internet import HttpInternet
from drone_mesh.internet.http_settings import HttpSettings

pytestmark = pytest.mark.slow


class SlowGateway(IGatewayCommands):
    """Does not finish an order before it is released."""

    def __init__(self):
        self.begun, self.go_on = threading.Event(), threading.Event()

    def send_goal_request_to_drone(self, node_id, latitude, longitude, height, now_s, shared=False):
        self.begun.set()
        assert self.go_on.wait(PATIENCE_S)
        return True

    def get_node_id(self):
        return 7

    def set_internet(self, works, now_s):
        raise AssertionError("HTTP does not tell whether there is internet")

    def get_known_nodes(self):
        raise RuntimeError("a bug in the routing technique")


@pytest.fixture
def slow():
    """A slow gateway whose thread is that of a pool, and its HTTP side."""
    gateway = SlowGateway()
    pool = ThreadPoolExecutor(max_workers=1)
    internet = HttpInternet(
        lambda work: pool.submit(work, 0.0), HttpSettings(port=0), answer_within_s=0.2
    )
    internet.connect(gateway)
    with httpx.Client(base_url=internet.url, timeout=PATIENCE_S, verify=False) as client:
        yield gateway, client
    gateway.go_on.set()
    internet.disconnect()
    pool.shutdown()


def http_threads():
    return [thread for thread in threading.enumerate() if thread.name == "http"]


def test_an_order_that_the_gateway_has_not_started_is_refused_and_never_carried_out(make_mesh):
    mesh = make_mesh(answer_within_s=0.2)
    sent, go_on = mesh.sent(), threading.Event()
    mesh.executor.submit(lambda _now_s: go_on.wait(PATIENCE_S))
    answer = mesh.client.post("/DroneMovement/1/2/3/4")
    go_on.set()
    mesh.executor.stop()  # has worked off what was waiting
    assert answer.status_code == 503
    assert "nothing was sent" in answer.json()["detail"]
    assert mesh.sent() == sent


def test_an_order_that_the_gateway_does_not_finish_is_answered_504(slow):
    _gateway, client = slow
    answer = client.post("/DroneMovement/1/2/3/4")
    assert answer.status_code == 504
    assert "has started" in answer.json()["detail"]


def test_after_a_late_answer_the_next_request_is_answered_as_usual(slow):
    gateway, client = slow
    client.post("/DroneMovement/1/2/3/4")
    gateway.go_on.set()
    wait_for("the gateway recovers", lambda: client.get("/ready").status_code == 200)
    assert client.post("/DroneMovement/1/2/3/4").status_code == 200


def test_a_bug_behind_one_request_is_logged_and_stops_nothing(slow, caplog):
    _gateway, client = slow
    assert client.get("/nodes").status_code == 500
    wait_for("a line in the log", lambda: "a bug in the routing technique" in caplog.text)
    # The connection of the request that failed is closed; the next one comes on its own.
    with httpx.Client(base_url=client.base_url, headers=client.headers) as next_client:
        assert next_client.get("/ready").status_code == 200


def test_disconnecting_on_the_gateways_own_thread_refuses_waiting_requests_and_ends(make_mesh):
    mesh = make_mesh(answer_within_s=PATIENCE_S)
    held, go_on = threading.Event(), threading.Event()

    def hold_then_disconnect(_now_s):
        held.set()
        assert go_on.wait(PATIENCE_S)
        mesh.internet.disconnect()

    mesh.executor.submit(hold_then_disconnect)
    assert held.wait(PATIENCE_S)
    with ThreadPoolExecutor(max_workers=1) as pool:
        order = pool.submit(mesh.client.post, "/DroneMovement/1/2/3/4")
        wait_for("the order comes in", lambda: mesh.executor._queue.qsize() == 1)
        go_on.set()
        answer = order.result(PATIENCE_S)
    mesh.executor.stop()
    assert answer.status_code == 503
    assert "nothing was sent" in answer.json()["detail"]
    with pytest.raises(httpx.ConnectError):
        mesh.client.get("/ready")


def test_disconnecting_twice_changes_nothing_and_gives_the_port_back(make_mesh):
    mesh = make_mesh()
    before = len(http_threads())
    mesh.internet.disconnect()
    mesh.internet.disconnect()
    assert len(http_threads()) == before - 1
    HttpInternet(mesh.executor.submit, HttpSettings(port=mesh.internet.port)).disconnect()


def test_disconnecting_right_after_connecting_ends(make_mesh):
    mesh = make_mesh()
    before = len(http_threads())
    internet = HttpInternet(mesh.executor.submit, HttpSettings(port=0))
    internet.connect(mesh.gateway)
    internet.disconnect()
    assert len(http_threads()) == before


def test_a_silent_client_does_not_delay_the_end(make_mesh):
    mesh = make_mesh()
    silent = http.client.HTTPConnection("127.0.0.1", mesh.internet.port, timeout=PATIENCE_S)
    silent.connect()
    silent.sock.sendall(b"GET /ready HT")
    mesh.internet.disconnect()
    with contextlib.suppress(ConnectionResetError):  # also an end: bytes had not been read by then
        assert silent.sock.recv(1) == b""
    silent.close()


def test_a_thousand_requests_in_a_row_leave_no_thread_and_no_memory_behind(make_mesh, caplog):
    caplog.set_level(logging.CRITICAL)  # so that the log that pytest keeps is not counted
    mesh = make_mesh()
    connection = http.client.HTTPConnection("127.0.0.1", mesh.internet.port, timeout=PATIENCE_S)

    def ask(requests):
        targets = ("/ready", "/nodes", "/DroneMovement/254/0/0/0", "/DroneMovement/99/0/0/0")
        for number in range(requests):
            target = targets[number % 4]
            connection.request("POST" if "Drone" in target else "GET", target)
            connection.getresponse().read()
        mesh.network.events.clear()  # which this test's network collects
        gc.collect()

    ask(500)  # objects that are created once exist after about 200 requests
    threads, grown_blocks = set(threading.enumerate()), []
    for _ in range(4):
        blocks = sys.getallocatedblocks()
        ask(250)
        grown_blocks.append(sys.getallocatedblocks() - blocks)
    connection.close()
    assert set(threading.enumerate()) <= threads
    # One block leaked per request would add 250 each time; other allocations come and go.
    assert min(grown_blocks) < 50


def test_a_gateway_that_nobody_asks_has_no_internet_until_somebody_does(make_mesh):
    mesh = make_mesh(token="0123456789abcdef0123", silence_s=0.5)
    has_internet = mesh.gateway.get_connected_to_gateway
    wait_for("no internet", lambda: not has_internet())
    refused = httpx.get(f"{mesh.internet.url}/nodes", verify=False)
    assert refused.status_code == 401
    assert not has_internet()
    assert mesh.client.get("/ready").status_code == 200
    wait_for("internet", has_internet)
    wait_for("no internet again", lambda: not has_internet())
