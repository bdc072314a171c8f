"""The console's page and WebSocket, as an ASGI application (Starlette).

Everything runs in one event loop, which owns the FrameStore, except orders: they block, so they run
in threads of their own. Each page has one task that sends frames. It builds a frame only after the
page has accepted the previous one, so a slow page gets fewer and larger frames; a page that accepts
nothing for SEND_TIMEOUT_S is disconnected.
"""

from __future__ import annotations

import asyncio
import contextlib
import dataclasses
import json
import logging
import math
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import MappingProxyType
from typing import Callable, Mapping, Sequence, TypeVar

from starlette.applications import Starlette
from starlette.middleware import Middleware
from starlette.requests import HTTPConnection, Request
from starlette.responses import FileResponse, PlainTextResponse, RedirectResponse, Response
from starlette.routing import Mount, Route, WebSocketRoute
from starlette.staticfiles import StaticFiles
from starlette.types import ASGIApp, Message, Receive, Scope, Send
from starlette.websockets import WebSocket, WebSocketDisconnect

from drone_mesh.communication.timing import Throttle
from drone_mesh.communication.wire.packet_types import PacketKind
from drone_mesh.console.controls import MeshControls, OrderRefused
from drone_mesh.console.dots import Dot
from drone_mesh.console.earth import EarthFiles
from drone_mesh.console.frame_store import EVENTS_KEPT, SAMPLES_KEPT, FrameStore
from drone_mesh.console.history import History
from drone_mesh.console.orders import (
    LIMITS,
    Acknowledge,
    Demonstrate,
    Foresee,
    LayoutOffer,
    NeighbourWatch,
    PacketWatch,
    PageOrder,
    PreviewLayout,
    ReadPlaces,
    TimeLine,
    number_of,
    parse_request,
)
from drone_mesh.console.page import Page
from drone_mesh.console.stage import Stage
from drone_mesh.console.tiles import Tiles
from drone_mesh.formations.preview import LostRoutes
from drone_mesh.view.palette import DARK, LIGHT, css_variables
from drone_mesh.web.access import Access, AccessDenied, TooManyGuesses

log = logging.getLogger(__name__)

T = TypeVar("T")

STATIC = Path(__file__).resolve().parent / "static"
FRAME_PERIOD_S = 0.2  # 5 Hz
SEND_TIMEOUT_S = 10.0
MOST_PAGES = 32
REFUSAL_LOG_PERIOD_S = 10.0
MOST_ORDERS_WAITING = 16  # per page
ORDER_THREADS = 8
EVENT_WITHIN_S = 5.0  # wall: after the answer to an order; hosts report every second
ALIVE_PERIOD_S = 0.5  # a page takes two seconds without a message for silence
MOST_LATE_S = 3.0  # an order of a page that has heard nothing for longer is refused
ALL_ACTIONS = (
    "fly", "power", "layout", "formation", "speed", "add", "remove", "mission", "fence",
    "demonstrate", "packets",
)  # fmt: skip
COOKIE = "drone_mesh_token"
POLICY_VIOLATION = 1008  # RFC 6455, 7.4.1
TRY_LATER = 1013  # registry of close codes of RFC 6455

_POLICY = "default-src 'self'; frame-ancestors 'none'; base-uri 'none'; form-action 'none'"
_HEADERS = {
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cache-Control": "no-cache",
}


class Guard:
    """ASGI middleware: refuses clients without access, and sets the headers of every response."""

    def __init__(self, app: ASGIApp, access: Access, image_sources: str) -> None:
        """`image_sources`: from where the page may load pictures."""
        self._app = app
        self._access = access
        policy = f"{_POLICY}; img-src {image_sources}"
        headers = {"Content-Security-Policy": policy, **_HEADERS}
        self._headers = [(key.lower().encode(), value.encode()) for key, value in headers.items()]
        self._refusals = Throttle(REFUSAL_LOG_PERIOD_S)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] == "lifespan":
            await self._app(scope, receive, send)
            return
        connection = HTTPConnection(scope)
        host = connection.headers.get("host", "")
        try:
            self._access.check_host(host)
            token = connection.query_params.get("token") or connection.cookies.get(COOKIE)
            if not self._access.is_right(token, _address_of(connection)):
                raise AccessDenied(
                    "token missing or invalid: open the console with the address that it printed"
                )
            if scope["type"] == "websocket":
                self._access.check_origin(connection.headers.get("origin"), host)
        except AccessDenied as error:
            if self._refusals.count("refused", time.monotonic()):
                number = self._refusals.counts["refused"]
                who = _address_of(connection)
                log.warning("console: refused %s: %s (refusal %d)", who, error, number)
            if scope["type"] == "websocket":
                await WebSocket(scope, receive, send).close(POLICY_VIOLATION)
            else:
                status = 429 if isinstance(error, TooManyGuesses) else 403
                await PlainTextResponse(f"{error}\n", status)(scope, receive, send)
            return

        async def send_with_headers(message: Message) -> None:
            if message["type"] == "http.response.start":
                theirs = {name for name, _value in message["headers"]}
                ours = [header for header in self._headers if header[0] not in theirs]
                message["headers"] = [*message["headers"], *ours]
            await send(message)

        await self._app(scope, receive, send_with_headers)


def _address_of(connection: HTTPConnection) -> str:
    return connection.client.host if connection.client else "unknown client"


class ConsoleServer:
    """Serves the page and keeps it up to date."""

    def __init__(
        self,
        store: FrameStore,
        controls: MeshControls,
        access: Access,
        layouts: Sequence[LayoutOffer] = (),
        demo: str = "",
        actions: Sequence[str] = ALL_ACTIONS,
        recording: str = "",
        whole: History | None = None,
        is_played: bool = True,
        tiles: Tiles | None = None,
    ) -> None:
        """`demo`: show this of DEMONSTRATIONS as soon as a page opens; `actions`: what it offers.

        `recording`: its name, if the console shows one; `whole`: its whole history. Without
        `whole`, pages look back at the store's history. A recording that is not playing is shown
        from its start. `tiles`: the map under a mesh with an origin.
        """
        self._tiles = tiles
        self._actions = actions
        self._store = store
        self._controls = controls
        self._layouts = layouts
        self._history = whole or store.history or History()
        self._is_played = is_played
        self._recording = recording
        self._pages: set[Page] = set()
        self._workers = ThreadPoolExecutor(ORDER_THREADS, thread_name_prefix="order")
        self._demo = demo or "repair"  # for the button
        self._stage = Stage(store, controls, self._workers, self._demo)
        self._demonstrate = bool(demo)
        self.app = Starlette(
            routes=[
                Route("/", self._index),
                Route("/palette.css", self._palette),
                EarthFiles(store, self._history, self._workers).route,
                *(tiles.routes if tiles else ()),
                Mount("/static", StaticFiles(directory=STATIC)),
                WebSocketRoute("/ws", self._websocket),
            ],
            middleware=[
                Middleware(
                    Guard, access=access, image_sources=tiles.image_sources if tiles else "'self'"
                )
            ],
        )

    @property
    def packets_wanted(self) -> bool:
        """Whether a page draws packets. Any thread."""
        return any(page.packets.wanted for page in tuple(self._pages))

    def show_packets(self, carried: int, dots: Sequence[Dot]) -> None:
        """`carried` packets arrived; `dots` are a sample of them."""
        for page in self._pages:
            page.show_packets(carried, dots)

    def close(self) -> None:
        """Accept no more orders. Running ones end by themselves."""
        self._workers.shutdown(wait=False)

    async def _index(self, request: Request) -> Response:
        if "token" in request.query_params:
            moved = RedirectResponse("/", 303)
            moved.set_cookie(COOKIE, request.query_params["token"], httponly=True, samesite="lax")
            return moved
        return FileResponse(STATIC / "index.html")

    async def _palette(self, _request: Request) -> Response:
        rules = {":root": LIGHT, ':root[data-theme="dark"]': DARK}
        text = "".join(f"{where} {{ {css_variables(what)} }}\n" for where, what in rules.items())
        return Response(text, media_type="text/css")

    async def _websocket(self, socket: WebSocket) -> None:
        if len(self._pages) >= MOST_PAGES:
            await socket.close(TRY_LATER)
            return
        page = Page(socket, self._store, self._history, self._is_played)
        self._pages.add(page)
        tasks: list[asyncio.Task[None]] = []
        try:
            await socket.accept()
            if self._demonstrate:
                self._demonstrate = False
                self._stage.begin()
            tasks.append(asyncio.ensure_future(self._send_frames(page)))
            tasks.append(asyncio.ensure_future(self._receive(page)))
            await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
        finally:
            self._pages.discard(page)
            # Cancel both, because wait_for may have swallowed an earlier cancellation.
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)

    async def _receive(self, page: Page) -> None:
        while page in self._pages:
            message = await page.socket.receive()
            if message["type"] == "websocket.disconnect":
                return
            text = message.get("text")
            if text is None:
                refusal = "invalid binary message: a request is JSON text"
                await self._answer(page, None, False, refusal)
            else:
                await self._on_request(page, text)

    async def _send_frames(self, page: Page) -> None:
        loop = asyncio.get_running_loop()
        try:
            hello: dict[str, object] = {
                "type": "hello",
                "layouts": list(self._layouts),
                "limits": {**LIMITS, "events": EVENTS_KEPT, "samples": SAMPLES_KEPT},
                "actions": list(self._actions),
                "packet_kinds": [kind.value for kind in PacketKind],
                "recording": self._recording,
                "demo": self._demo,
                "map": self._tiles.for_page() if self._tiles else None,
            }
            await self._send(page, json.dumps(hello))
            before_s = loop.time()
            alive_s = -math.inf
            # Before Python 3.12 wait_for may swallow a cancellation that arrives as a send ends.
            while page in self._pages:
                started_s = loop.time()
                for text in page.messages(started_s - before_s):
                    await self._send(page, text)
                before_s = started_s
                if started_s - alive_s >= ALIVE_PERIOD_S:
                    alive_s = started_s
                    await self._send(page, json.dumps({"type": "alive", "at": loop.time()}))
                await asyncio.sleep(max(0.0, started_s + FRAME_PERIOD_S - loop.time()))
        except asyncio.TimeoutError:
            log.info("console: disconnected a page that accepted nothing for %g s", SEND_TIMEOUT_S)
        except (WebSocketDisconnect, RuntimeError):
            log.debug("console: a page is gone")

    async def _send(self, page: Page, text: str) -> None:
        await asyncio.wait_for(page.socket.send_text(text), SEND_TIMEOUT_S)

    async def _on_request(self, page: Page, text: str) -> None:
        try:
            request = parse_request(text)
        except OrderRefused as error:
            await self._answer(page, number_of(text), False, str(error))
            return
        if isinstance(request, NeighbourWatch):
            page.watching = request.node
            if request.node is not None:
                await self._send(page, page.detail(request.node))
        elif isinstance(request, TimeLine):
            page.move(request)
        elif isinstance(request, PacketWatch):
            page.packets.wanted = request.on
        else:
            try:
                await self._do(page, request)
            except OrderRefused as error:
                await self._answer(page, request.number, False, str(error))

    async def _do(
        self,
        page: Page,
        request: PageOrder | ReadPlaces | PreviewLayout | Foresee | Acknowledge | Demonstrate,
    ) -> None:
        """Carry out a request and return its answer. Raises OrderRefused."""
        if isinstance(request, (PageOrder, Demonstrate)) and request.heard is not None:
            late_s = asyncio.get_running_loop().time() - request.heard
            if late_s > MOST_LATE_S:  # it was queued while page and console did not hear each other
                raise OrderRefused(
                    f"sent {late_s:.0f} s after the page last heard the console: not carried out"
                )
        if isinstance(request, Acknowledge):
            text = f"acknowledged {self._store.acknowledge(request.text)}"
        elif isinstance(request, Demonstrate):
            if request.plan:
                text = self._stage.plan()
            else:
                text = self._stage.begin() if request.on else self._stage.end()
        elif len(page.waiting) >= MOST_ORDERS_WAITING:
            raise OrderRefused("too many orders at once")
        else:
            # What is computed for one request makes the page's next order no later.
            task = asyncio.ensure_future(
                self._carry_out(page, request)
                if isinstance(request, PageOrder)
                else self._reply(page, request)
            )
            page.waiting.add(task)
            task.add_done_callback(page.waiting.discard)
            return
        await self._answer(page, request.number, True, text)

    async def _reply(self, page: Page, question: ReadPlaces | PreviewLayout | Foresee) -> None:
        about: Mapping[str, object]
        try:
            if isinstance(question, ReadPlaces):
                content = await self._in_worker(question.content, self._store.origin)
                text, about = "a layout", content._asdict()
            elif isinstance(question, PreviewLayout):
                found = await self._in_worker(self._controls.preview, question.case)
                text = found.in_words()
                about = {"preview": dataclasses.asdict(found), "lost": found.out_of_reach}
            else:
                mesh = self._store.mesh
                lost = await self._in_worker(question.lost_routes, mesh) if mesh else LostRoutes()
                text, about = lost.in_words(), {"lost": [*lost.there, *lost.cut_off]}
        except OrderRefused as error:
            await self._answer(page, question.number, False, str(error))
        else:
            await self._answer(page, question.number, True, text, about)

    async def _carry_out(self, page: Page, order: PageOrder) -> None:
        # Before it is carried out: its first event may come before its answer.
        ticket = self._store.expect_orders(order.drones(self._layouts))
        try:
            text = await self._in_worker(order.carry_out, self._controls)
        except OrderRefused as error:
            self._store.forget_expected(ticket)
            await self._answer(page, order.number, False, str(error))
        else:
            loop = asyncio.get_running_loop()
            loop.call_later(EVENT_WITHIN_S, self._store.forget_expected, ticket)
            await self._answer(page, order.number, True, text)
            for other in self._pages - {page}:
                other.tell(text)

    async def _in_worker(self, work: Callable[..., T], *what: object) -> T:
        return await asyncio.get_running_loop().run_in_executor(self._workers, work, *what)

    async def _answer(
        self,
        page: Page,
        number: int | None,
        done: bool,
        text: str,
        about: Mapping[str, object] = MappingProxyType({}),
    ) -> None:
        answer = {"type": "answer", "number": number, "done": done, "text": text, **about}
        # The page may have closed meanwhile.
        with contextlib.suppress(WebSocketDisconnect, RuntimeError, asyncio.TimeoutError):
            await self._send(page, json.dumps(answer))
