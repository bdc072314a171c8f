"""The console's HTTP and WebSocket server (aiohttp).

Everything in here runs in one event loop, which owns the FrameStore; only orders run in threads of
their own, because they wait for others. Each page has one task that sends: it waits until its page
took a frame before it makes the next one, so a slow page gets fewer and larger frames, and a page
that takes nothing for SEND_TIMEOUT_S is cut off.
"""

from __future__ import annotations

import asyncio
import json
import logging
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Awaitable, Callable, Sequence

from aiohttp import WSMsgType, web

from drone_mesh.console.access import Access, AccessDenied
from drone_mesh.console.frames import FrameStore
from drone_mesh.console.orders import MeshControls, Order, OrderRefused, Watch, parse_request

log = logging.getLogger(__name__)

STATIC = Path(__file__).resolve().parent / "static"
FRAME_PERIOD_S = 0.2  # 5 Hz
SEND_TIMEOUT_S = 10.0
PING_PERIOD_S = 10.0
MOST_PAGES = 32
MOST_ORDERS_WAITING = 16  # per page
LARGEST_REQUEST_BYTES = 4096
COOKIE = "drone_mesh_token"

Handler = Callable[[web.Request], Awaitable[web.StreamResponse]]


@dataclass(eq=False)
class Page:
    """One open page."""

    socket: web.WebSocketResponse
    transport: asyncio.WriteTransport | None
    version: int = 0  # what it knows
    watching: int | None = None
    orders: set[asyncio.Task[None]] = field(default_factory=set)


class ConsoleServer:
    """Serves the page and keeps it up to date.

    `layouts` are the (case, name) pairs that the page offers.
    """

    def __init__(
        self,
        store: FrameStore,
        controls: MeshControls,
        access: Access,
        layouts: Sequence[tuple[int, str]] = (),
    ) -> None:
        self._store = store
        self._controls = controls
        self._access = access
        self._layouts = layouts
        self._pages: set[Page] = set()
        self._workers = ThreadPoolExecutor(max_workers=8, thread_name_prefix="order")
        self.app = web.Application(middlewares=[self._guard], client_max_size=LARGEST_REQUEST_BYTES)
        self.app.router.add_get("/", self._index)
        self.app.router.add_get("/ws", self._websocket)
        self.app.router.add_static("/static", STATIC)
        self.app.on_shutdown.append(self._close_pages)

    @web.middleware
    async def _guard(self, request: web.Request, handler: Handler) -> web.StreamResponse:
        try:
            self._access.check_host(request.host)
            self._access.check_token(request.query.get("token") or request.cookies.get(COOKIE))
        except AccessDenied as error:
            log.warning("console: refused %s: %s", request.remote, error)
            return web.Response(status=403, text=f"{error}\n")
        response = await handler(request)
        if not response.prepared:
            response.headers["Content-Security-Policy"] = (
                "default-src 'self'; frame-ancestors 'none'; base-uri 'none'; form-action 'none'"
            )
            response.headers["X-Content-Type-Options"] = "nosniff"
            response.headers["Referrer-Policy"] = "no-referrer"
            response.headers["Cache-Control"] = "no-cache"
        return response

    async def _index(self, request: web.Request) -> web.StreamResponse:
        if "token" in request.query:
            moved = web.Response(status=303, headers={"Location": "/"})
            moved.set_cookie(COOKIE, request.query["token"], httponly=True, samesite="Strict")
            return moved
        return web.FileResponse(STATIC / "index.html")

    async def _websocket(self, request: web.Request) -> web.StreamResponse:
        try:
            self._access.check_origin(request.headers.get("Origin"), request.host)
        except AccessDenied as error:
            log.warning("console: refused %s: %s", request.remote, error)
            return web.Response(status=403, text=f"{error}\n")
        if len(self._pages) >= MOST_PAGES:
            return web.Response(status=503, text=f"{MOST_PAGES} pages are open already\n")
        socket = web.WebSocketResponse(
            heartbeat=PING_PERIOD_S, compress=False, max_msg_size=LARGEST_REQUEST_BYTES
        )
        await socket.prepare(request)
        page = Page(socket, request.transport)
        self._pages.add(page)
        sender = asyncio.ensure_future(self._send_frames(page))
        try:
            async for message in socket:
                if message.type == WSMsgType.TEXT:
                    await self._on_request(page, message.data)
        finally:
            self._pages.discard(page)
            sender.cancel()
            await asyncio.gather(sender, return_exceptions=True)
        return socket

    async def _send_frames(self, page: Page) -> None:
        loop = asyncio.get_running_loop()
        try:
            await self._send(page, json.dumps({"type": "hello", "layouts": list(self._layouts)}))
            while not page.socket.closed:
                started = loop.time()
                if page.version != self._store.version:
                    frame, page.version = self._store.frame_since(page.version), self._store.version
                    await self._send(page, frame)
                    if page.watching is not None:
                        await self._send(page, self._detail(page.watching))
                await asyncio.sleep(max(0.0, started + FRAME_PERIOD_S - loop.time()))
        except asyncio.TimeoutError:
            log.info("console: a page took nothing for %g s and is cut off", SEND_TIMEOUT_S)
            if page.transport is not None:
                page.transport.abort()
        except ConnectionError:
            log.debug("console: a page is gone")

    async def _send(self, page: Page, text: str) -> None:
        await asyncio.wait_for(page.socket.send_str(text), SEND_TIMEOUT_S)

    def _detail(self, node: int) -> str:
        return json.dumps(
            {"type": "detail", "node": node, "neighbours": self._store.neighbours_of(node)}
        )

    async def _on_request(self, page: Page, text: str) -> None:
        try:
            request = parse_request(text)
        except OrderRefused as error:
            await self._send(page, _answer(_number_in(text), False, str(error)))
            return
        if isinstance(request, Watch):
            page.watching = request.node
        elif len(page.orders) >= MOST_ORDERS_WAITING:
            await self._send(page, _answer(request.number, False, "too many orders at once"))
        else:
            task = asyncio.ensure_future(self._carry_out(page, request))
            page.orders.add(task)
            task.add_done_callback(page.orders.discard)

    async def _carry_out(self, page: Page, order: Order) -> None:
        loop = asyncio.get_running_loop()
        try:
            text = await loop.run_in_executor(self._workers, order.carry_out, self._controls)
            answer = _answer(order.number, True, text)
        except OrderRefused as error:
            answer = _answer(order.number, False, str(error))
        try:
            await self._send(page, answer)
        except (ConnectionError, asyncio.TimeoutError):
            log.debug("console: a page went before its answer came")

    async def _close_pages(self, _app: web.Application) -> None:
        for page in list(self._pages):
            await page.socket.close(code=1001, message=b"the console stops")
        self._workers.shutdown(wait=False)


def _answer(number: Any, done: bool, text: str) -> str:
    return json.dumps({"type": "answer", "number": number, "done": done, "text": text})


def _number_in(text: str) -> int | None:
    """The number of a refused request, so that the page knows which one it was."""
    try:
        number = json.loads(text).get("number")
    except (ValueError, AttributeError):
        return None
    return number if isinstance(number, int) else None
