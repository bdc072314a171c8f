"""HttpSettings: where a node answers HTTP, and to which clients."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from drone_mesh.internet import DEFAULT_PORT
from drone_mesh.web import LOOPBACK
from drone_mesh.web.access import Access, access_for, own_names

if TYPE_CHECKING:  # it loads ssl, which only HTTPS needs
    from drone_mesh.web.listening import Certificate


@dataclass(frozen=True)
class HttpSettings:
    """The address of a node's HTTP server, and its access rules."""

    address: str = LOOPBACK
    port: int = DEFAULT_PORT  # 0: any free one
    token: str = ""  # empty: none; then only this machine may send requests
    names: tuple[str, ...] = ()  # of this machine, besides its host name
    certificate: Certificate | None = None  # None: plain HTTP

    def access(self) -> Access:
        """The access rules. Raises ConfigurationError if others could connect without a token."""
        return access_for(self.address, self.token, own_names(*self.names) if self.token else ())
