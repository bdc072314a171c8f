"""Access to a gateway over HTTP: which clients, from where, and how large a request."""

from __future__ import annotations

import socket

import httpx
import pytest

from drone_mesh.errors import ConfigurationError
from drone_mesh.internet.http_internet import HttpInternet
from drone_mesh.internet.http_settings import HttpSettings
from drone_mesh.web import access

ORDER = "/DroneMovement/1/2/3/4"


@pytest.fixture(scope="module")
def stranger(guarded_mesh):
    """A client without the token."""
    with httpx.Client(base_url=guarded_mesh.internet.url, timeout=20.0, verify=False) as client:
        yield client


def never(_function):
    raise AssertionError("the gateway got no request")


@pytest.mark.parametrize(
    "operation", [("GET", "/ready"), ("GET", "/nodes"), ("GET", "/orders"), ("POST", ORDER)]
)
@pytest.mark.parametrize(
    "authorization",
    [None, "", "Bearer", "Bearer wrong", "Basic 0123456789abcdef0123", b"Bearer \xff"],
)
def test_without_the_token_nothing_is_answered_or_done(
    guarded_mesh, stranger, operation, authorization
):
    sent = guarded_mesh.sent()
    headers = {} if authorization is None else {"Authorization": authorization}
    answer = stranger.request(*operation, headers=headers)
    assert answer.status_code == 401
    assert answer.headers["WWW-Authenticate"] == "Bearer"
    assert "token" in answer.json()["detail"]
    assert guarded_mesh.sent() == sent


def test_a_wrong_token_is_refused_before_the_numbers_are_looked_at(stranger):
    assert stranger.post("/DroneMovement/999/2/3/4").status_code == 401


def test_who_guesses_tokens_is_slowed_down_and_logged_once(make_mesh, monkeypatch, caplog):
    monkeypatch.setattr(access, "GUESS_PERIOD_S", 1000.0)
    mesh = make_mesh(token="0123456789abcdef0123")
    headers = {"Authorization": "Bearer wrong"}
    answers = [mesh.client.get("/ready", headers=headers) for _ in range(20)]
    statuses = [answer.status_code for answer in answers]
    assert statuses == [401] * 10 + [429] * 10
    assert answers[-1].headers["Retry-After"] == "1"
    assert "too many wrong tokens" in answers[-1].json()["detail"]
    lines = [line for line in caplog.messages if "refused" in line]
    assert lines == ["HTTP: refused 127.0.0.1: invalid token (refusal 1)"]


def test_with_the_token_everything_is_answered(guarded_mesh):
    client = guarded_mesh.client
    assert client.get("/ready").status_code == 200
    assert client.get("/nodes").status_code == 200
    assert client.post("/DroneMovement/99/2/3/4").status_code == 503


def test_a_port_in_use_is_refused_with_what_to_do(mesh):
    with pytest.raises(ConfigurationError, match=f"port {mesh.internet.port} .*another port"):
        HttpInternet(never, HttpSettings(port=mesh.internet.port))


@pytest.mark.parametrize(
    ("address", "port", "reason"),
    [
        ("192.0.2.1", 0, "not an address of this machine"),
        ("127.0.0.1", 70000, "ports are 0..65535"),
        ("127.0.0.1", -1, "ports are 0..65535"),
        ("no such name", 0, "no such name port 0 not available"),
    ],
)
def test_an_address_that_is_not_available_is_refused_with_the_reason(address, port, reason):
    with pytest.raises(ConfigurationError, match=reason):
        HttpInternet(never, HttpSettings(address, port, token="0123456789abcdef"))


@pytest.mark.parametrize("host", ["evil.example", "evil.example:80", "192.0.2.1", "["])
def test_a_foreign_name_that_points_here_is_refused(mesh, host):
    answer = mesh.client.get("/ready", headers={"Host": host})
    assert answer.status_code == 403
    assert "not a loopback name" in answer.json()["detail"]


@pytest.mark.parametrize("origin", ["http://evil.example", "null", "https://127.0.0.1", "http://["])
def test_a_foreign_page_in_a_browser_of_this_machine_moves_no_drone(mesh, origin):
    sent = mesh.sent()
    answer = mesh.client.post(ORDER, headers={"Origin": origin})
    assert answer.status_code == 403
    assert mesh.sent() == sent


def test_the_page_that_the_gateway_itself_offers_may_ask(mesh):
    assert mesh.client.get("/ready", headers={"Origin": mesh.internet.url}).status_code == 200


@pytest.mark.parametrize(
    ("headers", "body", "status", "reason"),
    [
        ({}, b"x" * 1025, 413, "the body is larger than 1024 bytes"),
        ({}, b"x" * 3_000_000, 413, "the body is larger than 1024 bytes"),
        ({"Transfer-Encoding": "chunked"}, b"0\r\n\r\n", 411, "Content-Length is missing"),
    ],
)
def test_a_body_that_is_too_large_or_of_unknown_size_is_refused(
    mesh, headers, body, status, reason
):
    sent = mesh.sent()
    answer = mesh.client.post(ORDER, headers=headers, content=body)
    assert answer.status_code == status
    assert answer.json()["detail"] == reason
    assert mesh.sent() == sent


@pytest.mark.slow
def test_a_body_that_is_announced_as_huge_is_refused_before_it_comes(mesh):
    with socket.create_connection(("127.0.0.1", mesh.internet.port), timeout=20.0) as connection:
        head = f"POST {ORDER} HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: {10**19}\r\n\r\n"
        connection.sendall(head.encode())
        assert connection.recv(4096).startswith(b"HTTP/1.1 413 ")


def test_headers_that_are_too_long_are_refused(mesh):
    assert mesh.client.get("/ready", headers={"X": "y" * 8192}).status_code == 431


def test_a_small_unused_body_does_no_harm(mesh):
    assert mesh.client.post("/DroneMovement/99/2/3/4", content=b"{}").status_code == 503


def test_an_address_that_is_too_long_is_refused(mesh):
    assert mesh.client.get("/ready?" + "x" * 1024).status_code == 414
    assert mesh.client.post("/DroneMovement/" + "1" * 1024).status_code == 414


@pytest.mark.parametrize(
    "request_bytes",
    [
        b"\x00\x01\x02\r\n\r\n",
        b"GET /ready HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: many\r\n\r\n",
        b"POST / HTTP/1.1\r\nHost: a\r\nContent-Length: 1\r\nContent-Length: 2\r\n\r\nx",
    ],
)
def test_invalid_http_is_answered_400_and_the_connection_closed(mesh, request_bytes):
    with socket.create_connection(("127.0.0.1", mesh.internet.port), timeout=20.0) as connection:
        connection.sendall(request_bytes)
        answer = b""
        try:
            while received := connection.recv(4096):
                answer += received
        except ConnectionResetError:
            pass  # closed while it had not read all of ours
    assert answer.startswith(b"HTTP/1.1 400 ")
