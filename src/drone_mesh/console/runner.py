"""ConsoleRunner: the console's server in a thread of its own."""

from __future__ import annotations

from drone_mesh.console.server import ConsoleServer
from drone_mesh.web.server_thread import ServerThread

LARGEST_REQUEST_BYTES = 1_000_000  # a file of places with escaped characters
PING_PERIOD_S = 10.0  # a page that disappeared silently is noticed after two of these


class ConsoleRunner(ServerThread):
    """Serves from start to stop. Its thread owns the event loop, and with it the FrameStore."""

    def __init__(self, server: ConsoleServer, bind_address: str, port: int) -> None:
        """Take the port (0: any free one). Raises ConfigurationError if it is not available."""
        super().__init__(
            server.app,
            bind_address,
            port,
            name="console",
            ws="auto",
            ws_max_size=LARGEST_REQUEST_BYTES,
            ws_ping_interval=PING_PERIOD_S,
            ws_ping_timeout=PING_PERIOD_S,
            ws_per_message_deflate=False,
        )
        self._console = server

    def stop(self) -> None:
        """Close all pages and end; returns when the thread has ended."""
        super().stop()
        self._console.close()
