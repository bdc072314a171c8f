"""What is refused before a request is looked at: too large, or sent by somebody else's web page."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING

from starlette.datastructures import Headers
from starlette.responses import JSONResponse

from drone_mesh.web.access import Access, AccessDenied
from drone_mesh.web.server_thread import MAX_HEAD_BYTES

if TYPE_CHECKING:
    from starlette.types import ASGIApp, Receive, Scope, Send

MOST_BODY_BYTES = 1024  # our choice: no request needs a body; clients that send "{}" may
MOST_TARGET_BYTES = 1024  # our choice: five times the longest address that means something


class RequestGuard:
    """ASGI middleware. Who has the right token is not judged here but with each operation."""

    def __init__(self, app: ASGIApp, access: Access) -> None:
        self._app = app
        self._access = access
        self.refused: Counter[int] = Counter()  # by status

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        refusal = self._refusal(scope) if scope["type"] == "http" else None
        if refusal is None:
            await self._app(scope, receive, send)
            return
        status, reason = refusal
        self.refused[status] += 1
        # The rest of such a request is not worth reading.
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
            return 411, "say with Content-Length how long the body is; no request needs one"
        length = headers.get("content-length", "0")
        if not (length.isascii() and length.isdigit()):
            return 400, "Content-Length is no number"
        if len(length) > 9 or int(length) > MOST_BODY_BYTES:
            return 413, f"the body is larger than {MOST_BODY_BYTES} bytes; no request needs one"
        try:
            host = headers.get("host", "")
            self._access.check_host(host)
            if "origin" in headers:  # a browser: the page has to be ours
                self._access.check_origin(headers["origin"], host)
        except AccessDenied as error:
            return 403, str(error)
        return None
