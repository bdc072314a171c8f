"""The status of the node over HTTP, and a server for routers, which answer only this.

No `from __future__ import annotations` here: FastAPI reads the annotations at run time, also on
Python 3.8.
"""

from typing import Any, Callable, Dict, Iterable, Optional, Sequence

from fastapi import FastAPI
from fastapi.params import Depends as Guard

from drone_mesh.internet.guarded_app import REFUSALS, guarded_app
from drone_mesh.web.access import access_for, own_names
from drone_mesh.web.server_thread import ServerThread
from drone_mesh.web.tls import Certificate

MOST_CONNECTIONS = 64  # our choice; further ones get 503

ReadStatus = Callable[[], Dict[str, Any]]
"""Returns a node's status; any thread may call it."""


def add_status_request(app: FastAPI, guards: Sequence[Guard], status: ReadStatus) -> None:
    """`GET /status`."""
    refusals = {number: what for number, what in REFUSALS.items() if number not in (503, 504)}

    @app.get("/status", dependencies=list(guards), responses=refusals)
    async def node_status() -> Dict[str, Any]:
        """The status of this node: mesh, radio, flight, version."""
        return status()


class StatusServer(ServerThread):
    """The HTTP side of a router: `GET /status`."""

    def __init__(
        self,
        status: ReadStatus,
        bind_address: str,
        port: int,
        token: str = "",
        certificate: Optional[Certificate] = None,
        names: Iterable[str] = (),
    ) -> None:
        """Open the port (0: any free one). Raises ConfigurationError as HttpInternet does."""
        access = access_for(bind_address, token, own_names(*names) if token else ())
        app, guards = guarded_app("drone_mesh router", "Reports the status of this node.", access)
        add_status_request(app, guards, status)
        super().__init__(
            app,
            bind_address,
            port,
            name="http",
            certificate=certificate,
            ws="none",
            limit_concurrency=MOST_CONNECTIONS,
        )
