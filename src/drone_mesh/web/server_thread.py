"""ServerThread: an HTTP server (uvicorn) in a thread of its own."""

from __future__ import annotations

import asyncio
import logging
import threading
from typing import TYPE_CHECKING, Any, Callable

import uvicorn

from drone_mesh.web.listening import listen
from drone_mesh.web.prompt_protocol import PromptProtocol
from drone_mesh.web.tls import Certificate

if TYPE_CHECKING:
    from starlette.types import ASGIApp

MAX_HEAD_BYTES = 8192  # all headers of a request together
LAST_ANSWERS_WITHIN_S = 1  # for requests that are in progress when the server stops


class ServerThread:
    """Serves one ASGI application from start to stop; it cannot be started again.

    The event loop belongs to the thread; use `in_loop` to access its objects from other threads.
    `start` and `stop` are for the thread that owns this object.
    """

    def __init__(
        self,
        app: ASGIApp,
        bind_address: str,
        port: int,
        name: str,
        certificate: Certificate | None = None,
        **settings: Any,
    ) -> None:
        """Open the port (0: any free one). `name` is the thread's, `settings` are uvicorn's.

        With a certificate it serves HTTPS only.

        Raises ConfigurationError if the port is not available.
        """
        self._bind_address = bind_address
        self._scheme = "http" if certificate is None else "https"
        if certificate is not None:
            settings.update(ssl_certfile=certificate.cert, ssl_keyfile=certificate.key)
        self._socket = listen(bind_address, port)
        self.port: int = self._socket.getsockname()[1]
        self._loop: asyncio.AbstractEventLoop | None = None
        self._running = threading.Event()
        self._thread = threading.Thread(target=self._run, name=name)
        self._server = uvicorn.Server(
            uvicorn.Config(
                app,
                loop="asyncio",
                http=PromptProtocol,
                lifespan="off",
                log_config=None,
                log_level=logging.ERROR,  # one line per refused connection would be a flood
                access_log=False,
                server_header=False,
                proxy_headers=False,
                h11_max_incomplete_event_size=MAX_HEAD_BYTES,
                timeout_graceful_shutdown=LAST_ANSWERS_WITHIN_S,
                **settings,
            )
        )

    @property
    def url(self) -> str:
        """Address of the server, without a path."""
        name = f"[{self._bind_address}]" if ":" in self._bind_address else self._bind_address
        return f"{self._scheme}://{name}:{self.port}"

    def start(self) -> None:
        """Start serving; returns when `in_loop` can be used."""
        self._thread.start()
        self._running.wait()

    def stop(self) -> None:
        """Close all connections and the port; returns when the thread has ended."""
        self._server.should_exit = True
        if self._running.is_set():
            self._thread.join()
        self._socket.close()

    def in_loop(self, function: Callable[[], None]) -> None:
        """Have the loop call this soon. Does nothing before the start or after the stop."""
        if self._loop is not None and not self._loop.is_closed():
            self._loop.call_soon_threadsafe(function)

    def _run(self) -> None:
        try:
            asyncio.run(self._serve())
        finally:
            self._running.set()  # if creating the loop failed, `start` must not wait for it

    async def _serve(self) -> None:
        self._loop = asyncio.get_running_loop()
        self._running.set()
        await self._server.serve(sockets=[self._socket])
