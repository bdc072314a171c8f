"""HttpInternet: orders for a gateway over HTTP (FastAPI on uvicorn)."""

from __future__ import annotations

import asyncio
import logging
from typing import Any, Callable

from starlette.types import ASGIApp, Message, Receive, Scope, Send

from drone_mesh.communication.interfaces import IGatewayCommands, IInternetConnection
from drone_mesh.drone.geodesy import Origin
from drone_mesh.execution import Submit
from drone_mesh.internet.api import make_api
from drone_mesh.internet.asking import GatewayDesk
from drone_mesh.internet.guarded_app import HttpServer, ReadStatus
from drone_mesh.internet.http_settings import HttpSettings
from drone_mesh.users.desk import UsersDesk

ANSWER_WITHIN_S = 2.0  # over ten times the duration of an order to a lost node

_log = logging.getLogger(__name__)


class HttpInternet(IInternetConnection):
    """The HTTP connection of a gateway. Its server has its own thread.

    No request holds a lock or a thread while it waits for the gateway.
    """

    def __init__(
        self,
        submit: Submit,
        http: HttpSettings = HttpSettings(),  # noqa: B008 (frozen)
        answer_within_s: float = ANSWER_WITHIN_S,
        origin: Origin | None = None,
        status: ReadStatus | None = None,
        mesh: Callable[[int], dict[str, Any]] | None = None,
        users: UsersDesk | None = None,
        silence_s: float | None = None,
    ) -> None:
        """Open the port.

        `submit` runs a function on the thread that owns the gateway. With an `origin`, goals may be
        given in degrees; the node's `users` desk sends and receives messages. After `silence_s`
        (wall) without a request the gateway says that it has no internet; None: never. Raises
        ConfigurationError for an address that is not available, or that other machines can reach
        without a token.
        """
        self._desk = GatewayDesk(submit, answer_within_s)
        api = make_api(self._desk, http.access(), origin, status, mesh, users)
        self._submit = submit
        self._commands: IGatewayCommands | None = None
        self._watch = None if silence_s is None else AskedWatch(api, silence_s, self._asked)
        self._server = HttpServer(self._watch or api, http)
        self.port = self._server.port

    @property
    def url(self) -> str:
        return self._server.url

    def connect(self, commands: IGatewayCommands) -> None:
        """Answer requests through `commands` until `disconnect`. Call it only once."""
        self._desk.open(commands)
        self._commands = commands
        self._server.start()
        if self._watch is not None:
            self._server.in_loop(self._watch.begin)
        _log.info("gateway %d: orders over HTTP at %s/docs", commands.get_node_id(), self.url)

    def disconnect(self) -> None:
        """Refuse waiting requests, stop the server and release the port."""
        self._desk.close()
        self._server.stop()

    def _asked(self, works: bool) -> None:
        commands = self._commands
        if commands is None:
            return
        node = commands.get_node_id()
        if works:
            _log.info("gateway %d: asked over HTTP again", node)
        else:
            _log.warning("gateway %d: not asked over HTTP: it says that it has no internet", node)
        self._submit(lambda now_s: commands.set_internet(works, now_s))


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
