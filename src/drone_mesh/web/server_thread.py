"""ServerThread: an HTTP server (uvicorn) in its own thread, with limits for silent clients."""

from __future__ import annotations

import asyncio
import logging
import threading
from typing import TYPE_CHECKING, Any, Callable

import uvicorn
from uvicorn.protocols.http.h11_impl import H11Protocol

from drone_mesh.web.listening import Certificate, listen

if TYPE_CHECKING:
    from starlette.types import ASGIApp

MAX_HEAD_BYTES = 8192  # all headers of a request together
LAST_ANSWERS_WITHIN_S = 1  # for requests that are in progress when the server stops
HEAD_WITHIN_S = 5.0  # from connecting, or the first byte, to the end of the headers
MOST_SILENT = 32  # connections without a request; the oldest makes room for a new one


class PromptProtocol(H11Protocol):
    """Closes a connection whose request does not arrive in time, and no others.

    Silent connections cannot lock other clients out: there are always fewer of them than uvicorn's
    `limit_concurrency` allows. Belongs to the server's event loop.
    """

    def __init__(self, *args: Any, **settings: Any) -> None:
        super().__init__(*args, **settings)
        self._head_timer: asyncio.TimerHandle | None = None

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        super().connection_made(transport)
        self._wait_for_head()
        waiting = [c for c in self.connections if isinstance(c, PromptProtocol) and c.is_waiting]
        if len(waiting) > MOST_SILENT:
            min(waiting, key=PromptProtocol.due_s).give_up()

    def connection_lost(self, exc: Exception | None) -> None:
        self._head_is_there()
        super().connection_lost(exc)

    def data_received(self, data: bytes) -> None:
        super().data_received(data)
        speaks_websocket = self.transport.get_protocol() is not self
        is_answered = self.cycle is not None and not self.cycle.response_complete
        if speaks_websocket or is_answered:
            self._head_is_there()
        elif not self.is_waiting and not self.transport.is_closing():
            self._wait_for_head()

    @property
    def is_waiting(self) -> bool:
        """Whether no request has arrived that still needs an answer."""
        return self._head_timer is not None

    def due_s(self) -> float:
        """When its time runs out, in the loop's time."""
        return self._head_timer.when() if self._head_timer is not None else 0.0

    def give_up(self) -> None:
        self._head_is_there()
        self.transport.abort()

    def _wait_for_head(self) -> None:
        self._head_timer = self.loop.call_later(HEAD_WITHIN_S, self.give_up)

    def _head_is_there(self) -> None:
        if self._head_timer is not None:
            self._head_timer.cancel()
            self._head_timer = None


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
