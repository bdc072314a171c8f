"""HttpServer: the HTTP server of a node (uvicorn)."""

from __future__ import annotations

from fastapi import FastAPI

from drone_mesh.internet.http_settings import HttpSettings
from drone_mesh.web.server_thread import ServerThread

MOST_CONNECTIONS = 64  # our choice; further ones get 503


class HttpServer(ServerThread):
    """Serves the application of one node, in its own thread."""

    def __init__(self, app: FastAPI, http: HttpSettings) -> None:
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
