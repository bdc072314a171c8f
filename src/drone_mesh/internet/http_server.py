"""HttpServer: the HTTP server of a node (uvicorn)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from drone_mesh.internet.http_settings import HttpSettings
from drone_mesh.web.server_thread import ServerThread

if TYPE_CHECKING:
    from starlette.types import ASGIApp

MOST_CONNECTIONS = 64  # our choice; further ones get 503


class HttpServer(ServerThread):
    """Serves the application of one node, in its own thread."""

    def __init__(self, app: ASGIApp, http: HttpSettings) -> None:
        """Open the port. Raises ConfigurationError if it is not available."""
        super().__init__(
            app,
            http.address,
            http.port,
            name="http",
            certificate=http.certificate,
            ws="none",
            limit_concurrency=MOST_CONNECTIONS,
        )
