"""HttpInternet: orders for a gateway over HTTP (FastAPI on uvicorn)."""

from __future__ import annotations

import logging
import threading

import uvicorn

from drone_mesh.communication.interfaces import IGatewayCommands, IInternetConnection
from drone_mesh.internet.api import make_api
from drone_mesh.internet.asking import GatewayDesk, Submit
from drone_mesh.internet.request_guard import MOST_HEAD_BYTES
from drone_mesh.web.access import access_for
from drone_mesh.web.listening import listen

DEFAULT_PORT = 9080  # docs/raspberry-pi.md, "HTTP"
ANSWER_WITHIN_S = 2.0  # our choice: over ten times what an order to a node that is gone takes
MOST_CONNECTIONS = 64  # our choice; more are answered 503
LAST_ANSWERS_WITHIN_S = 1  # our choice: for requests that are under way when it disconnects

_log = logging.getLogger(__name__)


class HttpInternet(IInternetConnection):
    """A gateway's HTTP side. The server has a thread of its own, from connect to disconnect.

    No request holds a lock or a thread while it waits for the gateway.
    """

    def __init__(
        self,
        submit: Submit,
        bind_address: str = "127.0.0.1",
        port: int = DEFAULT_PORT,
        token: str = "",
        answer_within_s: float = ANSWER_WITHIN_S,
    ) -> None:
        """Take the port (0: any that is free).

        `submit` runs a function on the thread that owns the gateway. Without a token only this
        machine may ask. Raises ConfigurationError for an address that cannot be had, or that
        others can reach while no token is given.
        """
        self._bind_address = bind_address
        access = access_for(bind_address, token)
        self._desk = GatewayDesk(submit, answer_within_s)
        self._app = make_api(self._desk, access)
        self._socket = listen(bind_address, port)
        self.port: int = self._socket.getsockname()[1]
        self._server: uvicorn.Server | None = None
        self._thread: threading.Thread | None = None

    @property
    def url(self) -> str:
        """Where it is to be found."""
        name = f"[{self._bind_address}]" if ":" in self._bind_address else self._bind_address
        return f"http://{name}:{self.port}"

    def connect(self, commands: IGatewayCommands) -> None:
        """Answer requests, with what `commands` says, until disconnect; not again after that."""
        self._desk.open(commands)
        self._server = uvicorn.Server(
            uvicorn.Config(
                self._app,
                loop="asyncio",
                http="h11",
                ws="none",
                lifespan="off",
                log_config=None,
                log_level=logging.WARNING,
                access_log=False,
                server_header=False,
                proxy_headers=False,
                limit_concurrency=MOST_CONNECTIONS,
                h11_max_incomplete_event_size=MOST_HEAD_BYTES,
                timeout_graceful_shutdown=LAST_ANSWERS_WITHIN_S,
            )
        )
        self._thread = threading.Thread(target=self._serve, args=(self._server,), name="http")
        self._thread.start()
        _log.info("gateway %d: orders over HTTP at %s/docs", commands.get_node_id(), self.url)

    def disconnect(self) -> None:
        """Refuse what is still waiting, end the server and give the port back."""
        self._desk.close()
        if self._server is not None:
            self._server.should_exit = True
        if self._thread is not None:
            self._thread.join()
        self._socket.close()

    def _serve(self, server: uvicorn.Server) -> None:
        server.run(sockets=[self._socket])
