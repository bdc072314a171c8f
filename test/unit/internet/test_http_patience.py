"""Silent and slow clients, foreign names, TLS."""

from __future__ import annotations

import contextlib
import socket
import ssl
import subprocess
import time

import httpx
import pytest

from drone_mesh.errors import ConfigurationError
from drone_mesh.web import server_thread
from drone_mesh.web.listening import Certificate

pytestmark = pytest.mark.slow

TOKEN = "0123456789abcdef0123"
GET = b"GET /ready HTTP/1.1\r\nHost: 127.0.0.1\r\n"


def connect(mesh) -> socket.socket:
    return socket.create_connection(("127.0.0.1", mesh.internet.port), timeout=20.0)


def is_closed(connection: socket.socket) -> bool:
    """Whether the server has closed it; waits for that as long as the socket's time-out."""
    try:
        while connection.recv(4096):
            pass
    except ConnectionError:
        return True
    except socket.timeout:
        return False
    return True


def test_two_hundred_silent_connections_do_not_keep_others_out(make_mesh):
    mesh = make_mesh(token=TOKEN)
    with contextlib.ExitStack() as opened:
        for _ in range(200):
            opened.enter_context(connect(mesh))
        for _ in range(5):
            with httpx.Client(base_url=mesh.internet.url, verify=False) as client:
                answer = client.get("/ready", headers={"Authorization": f"Bearer {TOKEN}"})
                assert answer.status_code == 200


@pytest.mark.parametrize("begun", [b"", GET, GET + b"X: 1\r\n"])
def test_a_request_whose_head_does_not_end_is_given_up(make_mesh, monkeypatch, begun):
    monkeypatch.setattr(server_thread, "HEAD_WITHIN_S", 0.3)
    mesh = make_mesh()
    with connect(mesh) as connection:
        connection.sendall(begun)
        assert is_closed(connection)


def test_a_second_request_on_a_connection_has_to_end_too(make_mesh, monkeypatch):
    monkeypatch.setattr(server_thread, "HEAD_WITHIN_S", 0.3)
    mesh = make_mesh()
    with connect(mesh) as connection:
        connection.sendall(GET + b"\r\n")
        assert connection.recv(4096).startswith(b"HTTP/1.1 200")
        connection.sendall(GET)
        assert is_closed(connection)


def test_a_body_that_does_not_come_is_given_up_and_nothing_is_sent(make_mesh, monkeypatch):
    from drone_mesh.internet import request_guard

    monkeypatch.setattr(request_guard, "BODY_WITHIN_S", 0.3)
    mesh = make_mesh()
    sent = mesh.sent()
    head = b"POST /drones/1/goal HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Type: application/json\r\n"
    with connect(mesh) as connection:
        connection.sendall(head + b'Content-Length: 60\r\n\r\n{"latitude"')
        started_s = time.monotonic()
        connection.recv(4096)
        assert time.monotonic() - started_s < 15.0
    assert mesh.sent() == sent


@pytest.mark.parametrize(
    ("host", "status"),
    [
        ("127.0.0.1", 200),
        ("192.168.1.7:9080", 200),
        ("[fd00::7]:9080", 200),
        ("localhost", 200),
        (socket.gethostname(), 200),
        ("evil.example", 403),
        ("127.0.0.1.evil.example", 403),
        ("", 403),
    ],
)
def test_with_a_token_a_foreign_name_is_still_refused(guarded_mesh, host, status):
    assert guarded_mesh.client.get("/ready", headers={"Host": host}).status_code == status


def test_another_name_of_this_machine_may_be_added(make_mesh):
    mesh = make_mesh(token=TOKEN, names=("pi.field.example",))
    answer = mesh.client.get("/ready", headers={"Host": "Pi.Field.Example:9080"})
    assert answer.status_code == 200


@pytest.fixture
def certificate(tmp_path) -> Certificate:
    cert, key = tmp_path / "cert.pem", tmp_path / "key.pem"
    subprocess.run(
        ["openssl", "req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1"]
        + ["-nodes", "-keyout", str(key), "-out", str(cert), "-days", "2"]
        + ["-subj", "/CN=localhost", "-addext", "subjectAltName=IP:127.0.0.1,DNS:localhost"],
        check=True,
        capture_output=True,
    )
    return Certificate(cert, key)


def test_with_a_certificate_it_serves_https(make_mesh, certificate):
    mesh = make_mesh(certificate=certificate)
    assert mesh.internet.url.startswith("https://")
    trust = ssl.create_default_context(cafile=str(certificate.cert))
    with httpx.Client(base_url=mesh.internet.url, verify=trust) as client:
        assert client.get("/ready").json() == {"ready": True, "gateway": 0}


def test_a_certificate_that_cannot_be_used_is_refused_by_its_name(tmp_path, certificate):
    with pytest.raises(ConfigurationError, match=r"^--cert .*missing.pem: No such file"):
        Certificate(tmp_path / "missing.pem", certificate.key)
    certificate.key.write_text("no key", encoding="ascii")
    with pytest.raises(ConfigurationError, match="--key .*key.pem cannot be used"):
        Certificate(certificate.cert, certificate.key)
