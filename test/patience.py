"""What tests in real time share: a condition that is waited for, and a port that is free."""

from __future__ import annotations

import socket
import time
from typing import Callable

PATIENCE_S = 60.0  # on a busy machine; on an idle one nothing takes a tenth of it


def wait_for(what: str, holds: Callable[[], object]) -> None:
    """Return as soon as it holds."""
    deadline_s = time.monotonic() + PATIENCE_S
    while not holds():
        assert time.monotonic() < deadline_s, f"not within {PATIENCE_S:g} s: {what}"
        time.sleep(0.02)


_given: set[int] = set()


def free_port(kind: socket.SocketKind = socket.SOCK_STREAM) -> int:
    """A port of this machine that nobody uses, another one each time."""
    while True:
        with socket.socket(socket.AF_INET, kind) as probe:
            probe.bind(("127.0.0.1", 0))
            port = int(probe.getsockname()[1])
        if port not in _given:
            _given.add(port)
            return port
