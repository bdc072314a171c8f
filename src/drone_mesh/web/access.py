"""Access rules of the web servers.

Without a token a server listens on the loopback interface only and answers only requests to
loopback names, which defeats DNS rebinding. With a token, any client that has it may connect. In
both cases a WebSocket is opened only for the page that this server sent.
"""

from __future__ import annotations

import hmac
import ipaddress
from dataclasses import dataclass
from urllib.parse import urlsplit

from drone_mesh.errors import ConfigurationError, MeshError

SHORTEST_TOKEN = 16  # characters; our choice: out of reach of guessing over a network


class AccessDenied(MeshError):
    """A refused request; the text gives the reason."""


@dataclass(frozen=True)
class Access:
    """The rules of one server. Without a token only loopback names are answered."""

    token: str | None = None

    def check_host(self, host: str) -> None:
        """`host` is the Host header."""
        if self.token is None and not is_loopback(_host_name(f"//{host}")):
            raise AccessDenied(f"{host!r} is not a loopback name of this machine")

    def check_origin(self, origin: str | None, host: str) -> None:
        """`origin` is the Origin header; the requesting page must be ours."""
        if origin is None or _authority(origin) != host.lower():
            raise AccessDenied(
                f"the page {origin or 'without an origin'} was not sent by this server"
            )

    def check_token(self, token: str | None) -> None:
        """`token` is that of the request, from its address or its cookie."""
        if self.token is None:
            return
        if token is None or not hmac.compare_digest(token.encode(), self.token.encode()):
            raise AccessDenied(
                "token missing or invalid: open the console with the address that it printed"
            )


def access_for(bind_address: str, token: str) -> Access:
    """The rules for a server that listens at this address; an empty token means none."""
    if token and len(token) < SHORTEST_TOKEN:
        raise ConfigurationError(f"token: must have at least {SHORTEST_TOKEN} characters")
    if not token and not is_loopback(bind_address):
        raise ConfigurationError(
            f"address {bind_address}: other machines can reach it; set a token, or use 127.0.0.1"
        )
    return Access(token or None)


def is_loopback(name: str) -> bool:
    """Whether this host name or address is loopback."""
    if name.lower() == "localhost":
        return True
    try:
        return ipaddress.ip_address(name).is_loopback
    except ValueError:
        return False


def _authority(origin: str) -> str:
    try:
        return urlsplit(origin).netloc.lower()
    except ValueError:
        return ""


def _host_name(address: str) -> str:
    try:
        return urlsplit(address).hostname or ""
    except ValueError:
        return ""
