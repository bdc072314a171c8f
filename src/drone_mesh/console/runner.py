"""Where the console is served, in a thread of its own, and the token of its page."""

from __future__ import annotations

import secrets
import socket
from dataclasses import dataclass

from drone_mesh.console.server import ConsoleServer
from drone_mesh.web.access import Access, access_for, is_loopback
from drone_mesh.web.server_thread import ServerThread

LARGEST_REQUEST_BYTES = 4_000_000  # a plan with escaped characters
PING_PERIOD_S = 10.0  # a page that disappeared silently is noticed after two of these
_TOKEN_BYTES = 18
_EVERYWHERE = ("0.0.0.0", "::")  # addresses that mean all addresses of this machine


@dataclass(frozen=True)
class PageToken:
    """A token (empty: none), and the option in which the user gave it (empty: it is random)."""

    token: str
    given_in: str = ""

    @staticmethod
    def needed(address: str, given: str, given_in: str) -> PageToken:
        """The given token, or else a random one if other machines can reach the address."""
        if given:
            return PageToken(given, given_in)
        return PageToken("" if is_loopback(address) else secrets.token_urlsafe(_TOKEN_BYTES))

    def access(self, address: str) -> Access:
        """The access rules. Raises ConfigurationError for a token that is too short."""
        return access_for(address, self.token)

    def greeting(self, address: str, port: int) -> str:
        """The line that tells where the page is. It contains only a random token.

        Print it, do not log it: ROS publishes the log on /rosout.
        """
        name = socket.gethostname() if address in _EVERYWHERE else address
        page = f"console: http://{f'[{name}]' if ':' in name else name}:{port}/"
        if not self.token:
            return page
        if self.given_in:
            return f"{page}?token=TOKEN, where TOKEN is the content of {self.given_in}"
        return f"{page}?token={self.token}"


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
