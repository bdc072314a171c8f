"""PromptProtocol: uvicorn's HTTP/1.1 with time limits for silent or slow clients."""

from __future__ import annotations

import asyncio
from typing import Any

from uvicorn.protocols.http.h11_impl import H11Protocol

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
        """Close the connection."""
        self._head_is_there()
        self.transport.abort()

    def _wait_for_head(self) -> None:
        self._head_timer = self.loop.call_later(HEAD_WITHIN_S, self.give_up)

    def _head_is_there(self) -> None:
        if self._head_timer is not None:
            self._head_timer.cancel()
            self._head_timer = None
