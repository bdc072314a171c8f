"""Restarts, slow pages, strangers, and a large fleet."""

from __future__ import annotations

import contextlib
import json
import socket
import time

import httpx
import pytest
import websockets.exceptions
import websockets.sync.client
from conftest import WAIT_WITHIN_S
from test_page import PLACES, on_screen

TOKEN = "a-token-for-this-test"
TOO_BIG = 1009  # RFC 6455, 7.4.1
REFUSED = "net::ERR_CONNECTION_REFUSED"  # a page without its console says that it tries again
BEHIND_S = 2.0  # simulated; what a page shows may be this old


def test_a_page_reconnects_by_itself_after_the_server_was_restarted(start_console, visit):
    console = start_console("--skip", "25")
    page = visit(console.url)
    page.wait_for_drones(len(PLACES))
    assert page.unexpected() == []
    page.expect_complaints(REFUSED)
    assert console.stop() == 0
    page.wait_for("it says so", lambda: page.page.locator("#link").is_visible())
    assert "no connection" in page.page.inner_text("#link")
    console.start()
    page.wait_for("connected again", lambda: not page.page.locator("#link").is_visible())
    page.wait_for_drones(len(PLACES))
    page.page.click("#nodes tr[data-id='3']")
    page.page.click("#power")
    page.wait_for("orders work again", lambda: page.row(3, 2) == "off")


def test_an_order_without_a_connection_gets_a_readable_answer(start_console, visit):
    console = start_console("--skip", "25")
    page = visit(console.url)
    page.wait_for_drones(len(PLACES))
    page.expect_complaints(REFUSED)
    console.stop()
    page.wait_for("it noticed", lambda: page.page.locator("#link").is_visible())
    page.page.click("#pause", force=True)  # it is locked
    page.page.wait_for_selector(".toast.bad")
    assert "there is no connection to the console" in page.page.inner_text(".toast.bad")


def test_a_console_that_is_silent_is_shown_as_such_and_nothing_is_carried_out_later(
    start_console, visit
):
    console = start_console("--skip", "25")
    page = visit(console.url)
    page.wait_for_drones(len(PLACES))
    page.page.click("#nodes tr[data-id='3']")
    with console.stopped():
        page.wait_for("it says so", lambda: page.page.locator("#link").is_visible())
        assert "the console is silent, this is" in page.page.inner_text("#link")
        assert page.page.get_attribute("#power", "aria-disabled") == "true"
        assert page.page.evaluate("document.body.hasAttribute('data-old')")
        page.page.keyboard.press("p")
        page.page.wait_for_selector(".toast.bad")
        assert "nothing was sent" in page.page.inner_text(".toast.bad")
    page.wait_for("the present again", lambda: not page.page.locator("#link").is_visible())
    assert page.page.get_attribute("#power", "aria-disabled") == "false"
    assert page.row(3, 2) == "connected"


def test_an_order_that_was_held_up_on_its_way_is_refused(start_console):
    with connect(start_console("--skip", "25")) as page:
        heard = None
        while heard is None:
            message = json.loads(page.recv(timeout=WAIT_WITHIN_S))
            heard = message.get("at") if message["type"] == "alive" else None
        order = {"do": "power", "node": 3, "on": False}
        page.send(json.dumps({**order, "number": 1, "heard": heard - 60.0}))
        page.send(json.dumps({**order, "number": 2, "heard": heard}))
        answers = {}
        while len(answers) < 2:
            message = json.loads(page.recv(timeout=WAIT_WITHIN_S))
            if message["type"] == "answer":
                answers[message["number"]] = message
    assert not answers[1]["done"]
    assert "60 s after the page last heard the console" in answers[1]["text"]
    assert answers[2]["done"]


def clock(page) -> float:
    """The simulated time that the page shows."""
    return float(page.page.inner_text("#clock").partition(" s")[0])


def next_clock(socket, timeout: float | None) -> float:
    """The simulated time of the next frame. TimeoutError: none has arrived."""
    message = {"type": ""}
    while message["type"] != "frame":
        message = json.loads(socket.recv(timeout=timeout))
    return float(message["clock"]["t"])


def test_254_drones_are_shown_without_falling_behind(start_console, visit):
    console = start_console(
        "--routers", "253", "--gridsize", "16", "--spacing", "6", "--skip", "25"
    )
    page = visit(console.url)
    page.wait_for_drones(254)
    with connect(console) as other:
        newest_s = next_clock(other, timeout=None)
        enough_s = newest_s + 10.0  # a page at half speed is 5 s behind by then
        while newest_s < enough_s:
            newest_s = next_clock(other, timeout=None)

        def keeps_up() -> bool:
            # A page that cannot would lag further and further behind.
            nonlocal newest_s
            with contextlib.suppress(TimeoutError):
                while True:
                    newest_s = next_clock(other, timeout=0)
            return clock(page) >= newest_s - BEHIND_S

        page.wait_for("the page shows the present", keeps_up)
    node = 100
    page.page.click(f"#nodes tr[data-id='{node}']")
    page.page.click("#power")
    page.wait_for("the order is carried out", lambda: page.row(node, 2) == "off")


def connect(console, **headers):
    return websockets.sync.client.connect(
        f"ws://127.0.0.1:{console.port}/ws",
        additional_headers={k.capitalize(): v for k, v in headers.items() if k != "origin"},
        origin=headers.get("origin", console.url.rstrip("/")),
        compression=None,
        max_size=None,
        proxy=None,
    )


def status_of(console, **headers) -> int:
    """The HTTP status that opening a socket is answered with; 101: it is open."""
    try:
        with connect(console, **headers):
            return 101
    except websockets.exceptions.InvalidStatus as error:
        return error.response.status_code


@pytest.mark.parametrize("origin", ["http://evil.example", "http://127.0.0.1:1", None])
def test_a_socket_of_another_page_is_refused(start_console, origin):
    console = start_console()
    assert status_of(console, origin=origin) == 403
    assert status_of(console) == 101


def test_another_name_that_points_here_is_refused(start_console):
    console = start_console()
    answer = httpx.get(console.url, headers={"Host": "evil.example"})
    assert answer.status_code == 403
    assert "is not a loopback name" in answer.text


def test_without_the_token_there_is_neither_page_nor_socket(start_console, visit):
    console = start_console("--token", TOKEN)
    for path in ("", "static/app.js", "?token=wrong-token-wrong"):
        assert httpx.get(console.url + path).status_code == 403
    assert status_of(console) == 403
    assert status_of(console, cookie="drone_mesh_token=wrong") == 403
    assert status_of(console, cookie=f"drone_mesh_token={TOKEN}") == 101


def test_the_address_with_the_token_opens_the_page_and_the_token_leaves_the_address(
    start_console, visit
):
    console = start_console("--token", TOKEN, "--skip", "25")
    page = visit(f"{console.url}?token={TOKEN}")
    page.wait_for_drones(len(PLACES))
    assert page.page.url == console.url
    assert "token" not in page.page.evaluate("document.cookie"), "scripts can read the token"


def test_nonsense_from_a_page_is_answered_and_does_no_harm(start_console):
    answers = []
    with connect(start_console()) as page:
        for text in ("{", "[]", '{"do":"power","number":5,"node":999,"on":true}', '"x"'):
            page.send(text)
        while len(answers) < 4:
            message = json.loads(page.recv(timeout=WAIT_WITHIN_S))
            if message["type"] == "answer":
                answers.append(message)
    assert all(not answer["done"] and answer["text"] for answer in answers)
    assert answers[2]["number"] == 5


def test_a_message_that_is_too_large_ends_that_connection_alone(start_console, visit):
    console = start_console("--skip", "25")
    page = visit(console.url)
    page.wait_for_drones(len(PLACES))
    with connect(console) as loud:
        loud.send([*["x" * 1_000_000] * 4, "x"])  # the last fragment is too much
        with pytest.raises(websockets.exceptions.ConnectionClosed) as closed:
            listen_until_closed(loud)
    assert closed.value.rcvd.code == TOO_BIG
    assert not page.page.locator("#link").is_visible()


def listen_until_closed(page) -> None:
    deadline_s = time.monotonic() + WAIT_WITHIN_S
    while time.monotonic() < deadline_s:
        page.recv(timeout=WAIT_WITHIN_S)


def open_and_take_nothing(console) -> socket.socket:
    """A page that opens the WebSocket and never reads what it is sent."""
    page = socket.create_connection(("127.0.0.1", console.port))
    page.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    page.sendall(
        f"GET /ws HTTP/1.1\r\nHost: 127.0.0.1:{console.port}\r\nUpgrade: websocket\r\n"
        "Connection: Upgrade\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n"
        f"Sec-WebSocket-Version: 13\r\nOrigin: http://127.0.0.1:{console.port}\r\n\r\n".encode()
    )
    return page


def test_a_page_that_reads_nothing_delays_no_other_page(start_console, visit):
    console = start_console("--routers", "253", "--gridsize", "16", "--skip", "12")
    stuck = [open_and_take_nothing(console) for _ in range(4)]
    page = visit(console.url)
    page.wait_for_drones(254)
    moments = set()

    def frames_go_on() -> bool:
        moments.add(page.page.inner_text("#clock"))
        return len(moments) >= 20

    page.wait_for("twenty frames", frames_go_on)
    for raw in stuck:
        raw.close()


def test_pages_that_vanish_in_the_middle_are_forgotten(start_console, visit):
    console = start_console("--skip", "25")
    for _ in range(40):  # more than may be open at once
        raw = open_and_take_nothing(console)
        raw.recv(12)
        raw.close()
    page = visit(console.url)
    page.wait_for_drones(len(PLACES))
    assert on_screen(page, 0.0, 0.0)


def test_it_ends_at_once_although_pages_are_open(start_console, visit):
    console = start_console("--skip", "25")
    page = visit(console.url)
    page.wait_for_drones(len(PLACES))
    page.expect_complaints(REFUSED)
    started = time.monotonic()
    assert console.stop() == 0
    assert time.monotonic() - started < 5.0
