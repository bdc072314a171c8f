"""Who may use the console.

Without a token it listens on this machine alone, and answers only to this machine's own names: a
page elsewhere that lets its own name point to 127.0.0.1 is turned away. With a token, whoever knows
it may come from anywhere. Either way a WebSocket is opened only for the page this server sent.
"""

from __future__ import annotations

import hmac
import ipaddress
from dataclasses import dataclass
from urllib.parse import urlsplit

from drone_mesh.errors import ConfigurationError, MeshError

SHORTEST_TOKEN = 16  # characters; our choice: out of reach of guessing over a network


class AccessDenied(MeshError):
    """This request may not have what it asks for; the text says why."""


@dataclass(frozen=True)
class Access:
    """The rules of one server. Without a token only loopback names are answered."""

    token: str | None = None

    def check_host(self, host: str) -> None:
        """`host` is the Host header."""
        if self.token is None and not is_loopback(_host_name(f"//{host}")):
            raise AccessDenied(f"{host!r} is not a name of this machine's own interface")

    def check_origin(self, origin: str | None, host: str) -> None:
        """`origin` is the Origin header: the page that asks has to be ours."""
        if origin is None or _authority(origin) != host.lower():
            raise AccessDenied(f"the page {origin or 'without an origin'} is not of this console")

    def check_token(self, token: str | None) -> None:
        """`token` is what the request brought, in its address or its cookie."""
        if self.token is None:
            return
        if token is None or not hmac.compare_digest(token.encode(), self.token.encode()):
            raise AccessDenied("open the console with the address it printed: the token is missing")


def access_for(bind_address: str, token: str) -> Access:
    """The rules for a server that listens at this address; an empty token means none was given."""
    if token and len(token) < SHORTEST_TOKEN:
        raise ConfigurationError(f"token: at least {SHORTEST_TOKEN} characters are wanted")
    if not token and not is_loopback(bind_address):
        raise ConfigurationError(
            f"address {bind_address} can be reached by others: give a token, or use 127.0.0.1"
        )
    return Access(token or None)


def is_loopback(name: str) -> bool:
    """Whether this host name or address means the machine itself and nobody else."""
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
