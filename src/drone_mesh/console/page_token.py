"""The token of the page, and the address that is printed for it."""

from __future__ import annotations

import secrets
import socket
from dataclasses import dataclass

from drone_mesh.web.access import Access, access_for, is_loopback

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
