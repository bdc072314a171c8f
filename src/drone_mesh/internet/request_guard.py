"""Refuses requests that are too large or that a page of another site sends."""

from __future__ import annotations

import asyncio
import contextlib
from collections import Counter
from typing import TYPE_CHECKING

from starlette.datastructures import Headers
from starlette.responses import JSONResponse

from drone_mesh.web.access import Access, AccessDenied
from drone_mesh.web.server_thread import MAX_HEAD_BYTES

if TYPE_CHECKING:
    from starlette.types import ASGIApp, Message, Receive, Scope, Send

MOST_BODY_BYTES = 1024  # five times the longest goal in JSON
MOST_DISCARDED_BYTES = 10_000_000  # of a refused body
BODY_WITHIN_S = 2.0
MOST_TARGET_BYTES = 1024  # five times the longest valid address


class _PromptBody:
    """Delivers a request's body; a client that sends it too slowly counts as disconnected."""

    def __init__(self, receive: Receive) -> None:
        self._receive = receive
        self._complete = False

    async def __call__(self) -> Message:
        if self._complete:
            return await self._receive()  # waits until the client disconnects
        try:
            message = await asyncio.wait_for(self._receive(), BODY_WITHIN_S)
        except asyncio.TimeoutError:
            return {"type": "http.disconnect"}
        self._complete = not message.get("more_body", False)
        return message


async def _discard_body(receive: Receive) -> None:
    left_bytes = MOST_DISCARDED_BYTES
    while left_bytes > 0:
        message = await receive()
        left_bytes -= len(message.get("body", b""))
        if not message.get("more_body", False):
            return


class RequestGuard:
    """ASGI middleware. Each operation checks the token itself."""

    def __init__(self, app: ASGIApp, access: Access) -> None:
        self._app = app
        self._access = access
        self.refused: Counter[int] = Counter()  # by status

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        refusal = self._refusal(scope) if scope["type"] == "http" else None
        if refusal is None:
            body = _PromptBody(receive) if scope["type"] == "http" else receive
            await self._app(scope, body, send)
            return
        status, reason = refusal
        self.refused[status] += 1
        if status == 413 and "expect" not in Headers(scope=scope):
            # If the client is still sending, it would get a reset instead of the answer.
            with contextlib.suppress(asyncio.TimeoutError):
                await asyncio.wait_for(_discard_body(receive), BODY_WITHIN_S)
        response = JSONResponse({"detail": reason}, status, headers={"Connection": "close"})
        await response(scope, receive, send)

    def _refusal(self, scope: Scope) -> tuple[int, str] | None:
        headers = Headers(scope=scope)
        target_bytes = len(scope.get("raw_path") or b"") + len(scope["query_string"])
        if target_bytes > MOST_TARGET_BYTES:
            return 414, f"the address is longer than {MOST_TARGET_BYTES} bytes"
        if sum(len(name) + len(value) for name, value in headers.raw) > MAX_HEAD_BYTES:
            return 431, f"the headers are longer than {MAX_HEAD_BYTES} bytes"
        if "transfer-encoding" in headers:
            return 411, "Content-Length is missing"
        length = headers.get("content-length", "0")
        if not (length.isascii() and length.isdigit()):
            return 400, "invalid Content-Length"
        if len(length) > 9 or int(length) > MOST_BODY_BYTES:
            return 413, f"the body is larger than {MOST_BODY_BYTES} bytes"
        try:
            host = headers.get("host", "")
            self._access.check_host(host)
            if "origin" in headers:  # a browser: the page must be ours
                self._access.check_origin(headers["origin"], host)
        except AccessDenied as error:
            return 403, str(error)
        return None
