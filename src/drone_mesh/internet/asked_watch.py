"""AskedWatch: whether anybody still asks a gateway over HTTP."""

from __future__ import annotations

import asyncio
from typing import TYPE_CHECKING, Callable

if TYPE_CHECKING:
    from starlette.types import ASGIApp, Message, Receive, Scope, Send


class AskedWatch:
    """ASGI middleware. Belongs to the server's event loop; refused requests do not count."""

    def __init__(self, app: ASGIApp, silence_s: float, changed: Callable[[bool], None]) -> None:
        """`changed(False)`: nobody has asked for `silence_s` (wall); `changed(True)`: again."""
        self._app = app
        self._silence_s = silence_s
        self._changed = changed
        self._is_asked = True
        self._timer: asyncio.TimerHandle | None = None

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        is_accepted = False

        async def watched(message: Message) -> None:
            nonlocal is_accepted
            if message["type"] == "http.response.start":
                is_accepted = message["status"] < 400
            if is_accepted:  # also with each piece of a long answer
                self.begin()
                self._tell(True)
            await send(message)

        await self._app(scope, receive, watched)

    def begin(self) -> None:
        """Count the silence from now on."""
        if self._timer is not None:
            self._timer.cancel()
        loop = asyncio.get_running_loop()
        self._timer = loop.call_later(self._silence_s, self._tell, False)

    def _tell(self, is_asked: bool) -> None:
        if is_asked is not self._is_asked:
            self._is_asked = is_asked
            self._changed(is_asked)
