"""The status of the node over HTTP, and a server for routers, which answer only this.

No `from __future__ import annotations` here: FastAPI reads the annotations at run time, also on
Python 3.8.
"""

from typing import Any, Callable, Dict

from fastapi import APIRouter

from drone_mesh.internet.guarded_app import HttpServer, guarded_app
from drone_mesh.internet.http_settings import HttpSettings

ReadStatus = Callable[[], Dict[str, Any]]
"""Returns a node's status; any thread may call it."""


def status_request(status: ReadStatus) -> APIRouter:
    """`GET /status`."""
    router = APIRouter()

    @router.get("/status")
    async def node_status() -> Dict[str, Any]:
        """The status of this node: mesh, radio, flight, version."""
        return status()

    return router


class StatusServer(HttpServer):
    """The HTTP side of a router: `GET /status`."""

    def __init__(self, status: ReadStatus, http: HttpSettings) -> None:
        """Open the port. Raises ConfigurationError as HttpInternet does."""
        about = "Reports the status of this node."
        request = status_request(status)
        super().__init__(guarded_app("drone_mesh router", about, http.access(), request), http)
