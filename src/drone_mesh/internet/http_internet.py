"""HttpInternet: orders for a gateway over HTTP (FastAPI on uvicorn)."""

from __future__ import annotations

import logging
from typing import Any, Callable, Iterable

from drone_mesh.communication.interfaces import IGatewayCommands, IInternetConnection
from drone_mesh.drone.geodesy import Origin
from drone_mesh.internet import DEFAULT_ADDRESS, DEFAULT_PORT
from drone_mesh.internet.api import make_api
from drone_mesh.internet.asking import GatewayDesk, Submit
from drone_mesh.internet.status import MOST_CONNECTIONS, ReadStatus
from drone_mesh.users.desk import UsersDesk
from drone_mesh.web.access import access_for, own_names
from drone_mesh.web.server_thread import ServerThread
from drone_mesh.web.tls import Certificate

ANSWER_WITHIN_S = 2.0  # our choice: over ten times the duration of an order to a lost node

_log = logging.getLogger(__name__)


class HttpInternet(IInternetConnection):
    """The HTTP connection of a gateway. Its server has its own thread.

    No request holds a lock or a thread while it waits for the gateway.
    """

    def __init__(
        self,
        submit: Submit,
        bind_address: str = DEFAULT_ADDRESS,
        port: int = DEFAULT_PORT,
        token: str = "",
        answer_within_s: float = ANSWER_WITHIN_S,
        certificate: Certificate | None = None,
        names: Iterable[str] = (),
        origin: Origin | None = None,
        status: ReadStatus | None = None,
        mesh: Callable[[int], dict[str, Any]] | None = None,
        users: UsersDesk | None = None,
    ) -> None:
        """Open the port (0: any free one).

        `submit` runs a function on the thread that owns the gateway. Without a token only this
        machine may send requests; with one, `names` are the host names of this machine that clients
        may use. With an `origin`, goals may be given in degrees; the node's `users` desk sends and
        receives messages. Raises ConfigurationError for an address that is not available, or that
        other machines can reach without a token.
        """
        access = access_for(bind_address, token, own_names(*names) if token else ())
        self._desk = GatewayDesk(submit, answer_within_s)
        self._server = ServerThread(
            make_api(self._desk, access, origin, status, mesh, users),
            bind_address,
            port,
            name="http",
            certificate=certificate,
            ws="none",
            limit_concurrency=MOST_CONNECTIONS,
        )
        self.port = self._server.port

    @property
    def url(self) -> str:
        """Address of this server."""
        return self._server.url

    def connect(self, commands: IGatewayCommands) -> None:
        """Answer requests, from the reports of `commands`, until `disconnect`; only once."""
        self._desk.open(commands)
        self._server.start()
        _log.info("gateway %d: orders over HTTP at %s/docs", commands.get_node_id(), self.url)

    def disconnect(self) -> None:
        """Refuse waiting requests, stop the server and release the port."""
        self._desk.close()
        self._server.stop()
