"""The status of the node over HTTP, and a server for routers, which answer only this.

No `from __future__ import annotations` here: FastAPI reads the annotations at run time, also on
Python 3.8.
"""

from typing import Any, Callable, Dict, Sequence

from fastapi import FastAPI
from fastapi.params import Depends as Guard

from drone_mesh.internet.guarded_app import REFUSALS, guarded_app
from drone_mesh.internet.http_server import HttpServer
from drone_mesh.internet.http_settings import HttpSettings

ReadStatus = Callable[[], Dict[str, Any]]
"""Returns a node's status; any thread may call it."""


def add_status_request(app: FastAPI, guards: Sequence[Guard], status: ReadStatus) -> None:
    """`GET /status`."""
    refusals = {number: what for number, what in REFUSALS.items() if number not in (503, 504)}

    @app.get("/status", dependencies=list(guards), responses=refusals)
    async def node_status() -> Dict[str, Any]:
        """The status of this node: mesh, radio, flight, version."""
        return status()


class StatusServer(HttpServer):
    """The HTTP side of a router: `GET /status`."""

    def __init__(self, status: ReadStatus, http: HttpSettings) -> None:
        """Open the port. Raises ConfigurationError as HttpInternet does."""
        about = "Reports the status of this node."
        app, guards = guarded_app("drone_mesh router", about, http.access())
        add_status_request(app, guards, status)
        super().__init__(app, http)
