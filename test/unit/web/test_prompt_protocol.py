"""The server's time limits for silent clients; HTTP is tested in test_http_patience."""

from __future__ import annotations

import time

import pytest
from starlette.applications import Starlette
from starlette.routing import WebSocketRoute
from starlette.websockets import WebSocket
from websockets.sync.client import connect

from drone_mesh.web import server_thread
from drone_mesh.web.server_thread import ServerThread

PATIENCE_S = 0.2


async def echo(socket: WebSocket) -> None:
    await socket.accept()
    await socket.send_text(await socket.receive_text())


@pytest.mark.slow
def test_a_websocket_may_be_silent_for_longer_than_a_request(monkeypatch):
    monkeypatch.setattr(server_thread, "HEAD_WITHIN_S", PATIENCE_S)
    app = Starlette(routes=[WebSocketRoute("/ws", echo)])
    server = ServerThread(app, "127.0.0.1", 0, name="echo", ws="auto")
    server.start()
    try:
        with connect(f"ws://127.0.0.1:{server.port}/ws", open_timeout=10) as socket:
            time.sleep(3 * PATIENCE_S)
            socket.send("still here")
            assert socket.recv(timeout=10) == "still here"
    finally:
        server.stop()
