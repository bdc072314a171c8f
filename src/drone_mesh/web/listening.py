"""The TCP port of an HTTP server, and its certificate."""

from __future__ import annotations

import errno
import socket
import ssl
import stat
from dataclasses import dataclass
from pathlib import Path

from drone_mesh.arguments import is_whole
from drone_mesh.errors import ConfigurationError

MAX_PORT = 65535
BACKLOG = 64

_HINTS = {
    errno.EADDRINUSE: "another program uses it; choose another port",
    errno.EACCES: "only root may use it; choose a port from 1024 up",
    errno.EADDRNOTAVAIL: "it is not an address of this machine",
}


def port_of(value: object) -> int:
    """This port as a number. Raises ConfigurationError."""
    if not (is_whole(str(value)) and 0 <= int(str(value)) <= MAX_PORT):
        raise ConfigurationError(f"invalid port {value}: must be a whole number 0..{MAX_PORT}")
    return int(str(value))


def listen(bind_address: str, port: int) -> socket.socket:
    """A listening socket; port 0 takes any that is free. Raises ConfigurationError."""
    wanted = f"HTTP address {bind_address} port {port}"
    if not 0 <= port <= MAX_PORT:
        raise ConfigurationError(f"{wanted} not available: ports are 0..{MAX_PORT}")
    sock = None
    try:
        # asyncio sets TCP_NODELAY only if the socket names its protocol: a request then takes 1 ms;
        # with socket.create_server it takes 45 ms.
        family, kind, protocol, _, where = socket.getaddrinfo(
            bind_address, port, type=socket.SOCK_STREAM, proto=socket.IPPROTO_TCP
        )[0]
        sock = socket.socket(family, kind, protocol)
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        sock.bind(where)
        sock.listen(BACKLOG)
    except OSError as error:
        if sock is not None:
            sock.close()
        hint = _HINTS.get(error.errno or 0, str(error))
        raise ConfigurationError(f"{wanted} not available: {hint}") from error
    return sock


@dataclass(frozen=True)
class Certificate:
    """PEM files: the certificate with its chain, and its private key."""

    cert: Path
    key: Path

    def __post_init__(self) -> None:
        """Raise ConfigurationError unless both files can be read and match."""
        for option, path in (("--cert", self.cert), ("--key", self.key)):
            try:
                if not stat.S_ISREG(path.stat().st_mode):  # a pipe would block whoever opens it
                    raise ConfigurationError(f"{option} {path}: not a regular file")
                path.open("rb").close()
            except OSError as error:
                raise ConfigurationError(f"{option} {path}: {error.strerror}") from error
        try:
            ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER).load_cert_chain(self.cert, self.key)
        except (OSError, ssl.SSLError) as error:
            raise ConfigurationError(
                f"--cert {self.cert} and --key {self.key} cannot be used: expected a certificate "
                f"and its private key, in PEM ({error})"
            ) from error
