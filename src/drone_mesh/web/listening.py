"""Takes a TCP port for an HTTP server, or says why it cannot be had."""

from __future__ import annotations

import errno
import socket

from drone_mesh.errors import ConfigurationError

MAX_PORT = 65535
BACKLOG = 64  # connections that may wait to be accepted; our choice

_HINTS = {
    errno.EADDRINUSE: "another program uses it; choose another port",
    errno.EACCES: "only root may use it; choose a port from 1024 up",
    errno.EADDRNOTAVAIL: "it is not an address of this machine",
}


def listen(bind_address: str, port: int) -> socket.socket:
    """A listening socket; port 0 takes any that is free. Raises ConfigurationError."""
    wanted = f"HTTP address {bind_address} port {port}"
    if not 0 <= port <= MAX_PORT:
        raise ConfigurationError(f"{wanted} cannot be had: ports are 0..{MAX_PORT}")
    sock = None
    try:
        # asyncio answers without delay (TCP_NODELAY) only where the protocol was named: on such a
        # socket a request takes 1 ms, on that of socket.create_server 45.
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
        raise ConfigurationError(f"{wanted} cannot be had: {hint}") from error
    return sock
