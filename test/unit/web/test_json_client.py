"""Requests for JSON: every failure is one line with the address."""

from __future__ import annotations

import socket
import threading

import pytest

from drone_mesh.web.json_client import NoAnswer, ask_json


@pytest.fixture
def answering():
    """A function that starts a server with this answer to one request; it returns the URL."""
    listeners, threads = [], []

    def serve(answer: bytes) -> str:
        listener = socket.create_server(("127.0.0.1", 0))
        listeners.append(listener)

        def answer_one() -> None:
            client, _ = listener.accept()
            with client:
                client.recv(4096)
                client.sendall(answer)

        threads.append(threading.Thread(target=answer_one))
        threads[-1].start()
        return f"http://127.0.0.1:{listener.getsockname()[1]}/mesh"

    yield serve
    for thread in threads:
        thread.join()
    for listener in listeners:
        listener.close()


@pytest.mark.parametrize(
    ("answer", "why"),
    [
        (b"SSH-2.0-OpenSSH_9.2\r\n", "no answer from {url}: SSH-2.0-OpenSSH_9.2"),
        (b"", "no answer from {url}: Remote end closed connection without response"),
        (
            b'HTTP/1.1 200 OK\r\nContent-Length: 99\r\n\r\n{"nodes": ',
            "no answer from {url}: IncompleteRead",
        ),
        (b"HTTP/1.1 200 OK\r\n\r\n<html>", "the answer from {url} is not JSON: Expecting value"),
    ],
    ids=["not HTTP", "nothing", "half of it", "not JSON"],
)
def test_an_invalid_answer_gives_one_line_with_the_address(answering, answer, why):
    url = answering(answer)
    with pytest.raises(NoAnswer) as error:
        ask_json(url, 5.0)
    line = str(error.value)
    assert line.startswith(why.format(url=url))
    assert "\n" not in line


@pytest.mark.parametrize(
    ("body", "text"),
    [
        (b'{"detail": "no drone 7"}', "no drone 7"),
        (b'{"detail": "no dr', "{url}: HTTP Error 404: Not Found"),
    ],
    ids=["whole", "half of it"],
)
def test_a_refusal_has_the_reason_of_the_server_if_it_arrives(answering, body, text):
    head = b"HTTP/1.1 404 Not Found\r\nContent-Length: 24\r\n\r\n"
    url = answering(head + body)
    with pytest.raises(NoAnswer) as error:
        ask_json(url, 5.0)
    assert str(error.value) == text.format(url=url)


@pytest.mark.parametrize("url", ["10.0.0.5/mesh", "http://[::1/mesh", "http://pi:port/mesh"])
def test_an_invalid_address_is_named(url):
    with pytest.raises(NoAnswer) as error:
        ask_json(url, 5.0)
    assert str(error.value).startswith(f"no answer from {url}: ")
