"""ConsoleRunner: the console's server in a thread of its own (uvicorn)."""

from __future__ import annotations

import asyncio
import logging
import threading
from typing import Callable

import uvicorn

from drone_mesh.console.server import ConsoleServer
from drone_mesh.web.listening import listen

LARGEST_REQUEST_BYTES = 4096
LARGEST_HEAD_BYTES = 8192
PING_PERIOD_S = 10.0  # a page that vanished without a word is noticed after two of these
LAST_ANSWERS_WITHIN_S = 1


class ConsoleRunner:
    """Serves from start to stop. The event loop, and with it the FrameStore, is its thread's.

    Use `in_loop` to reach the store from another thread.
    """

    def __init__(self, server: ConsoleServer, bind_address: str, port: int) -> None:
        """Takes the port (0: any that is free). Raises ConfigurationError if it cannot be had."""
        self._console = server
        self._socket = listen(bind_address, port)
        self.port: int = self._socket.getsockname()[1]
        self._loop: asyncio.AbstractEventLoop | None = None
        self._running = threading.Event()
        self._thread = threading.Thread(target=self._run, name="console")
        self._server = uvicorn.Server(
            uvicorn.Config(
                server.app,
                loop="asyncio",
                http="h11",
                ws="auto",
                ws_max_size=LARGEST_REQUEST_BYTES,
                ws_ping_interval=PING_PERIOD_S,
                ws_ping_timeout=PING_PERIOD_S,
                ws_per_message_deflate=False,
                lifespan="off",
                log_config=None,
                log_level=logging.WARNING,
                access_log=False,
                server_header=False,
                proxy_headers=False,
                h11_max_incomplete_event_size=LARGEST_HEAD_BYTES,
                timeout_graceful_shutdown=LAST_ANSWERS_WITHIN_S,
            )
        )

    def start(self) -> None:
        """Begin to serve; returns when `in_loop` can be used."""
        self._thread.start()
        self._running.wait()

    def stop(self) -> None:
        """Close all pages and end; returns when the thread has ended."""
        self._server.should_exit = True
        self._thread.join()
        self._console.close()
        self._socket.close()

    def in_loop(self, function: Callable[[], None]) -> None:
        """Have the loop call this soon. Does nothing once the server has stopped."""
        if self._loop is not None and not self._loop.is_closed():
            self._loop.call_soon_threadsafe(function)

    def _run(self) -> None:
        asyncio.run(self._serve())

    async def _serve(self) -> None:
        self._loop = asyncio.get_running_loop()
        self._running.set()
        await self._server.serve(sockets=[self._socket])
