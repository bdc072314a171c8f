"""Allowance: how often a client may do something."""

from __future__ import annotations

import ipaddress
import threading
import time
from typing import Callable

MOST_CLIENTS = 1024


class Allowance:
    """Lets each client do something `at_once` times, then once per period. Any thread."""

    def __init__(
        self, at_once: int, period_s: float, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._slack_s = (at_once - 1) * period_s
        self._period_s = period_s
        self._clock = clock
        self._lock = threading.Lock()  # held while something is noted
        self._used_up_s: dict[str, float] = {}  # by client: until then what it did counts

    def is_over(self, client: str = "") -> bool:
        """Whether this client has to wait."""
        return self._used_up_s.get(client, 0.0) - self._clock() > self._slack_s

    def note(self, client: str = "") -> None:
        """This client did it once more."""
        with self._lock:
            until_s = max(self._clock(), self._used_up_s.pop(client, 0.0))
            self._used_up_s[client] = until_s + self._period_s
            if len(self._used_up_s) > MOST_CLIENTS:
                del self._used_up_s[next(iter(self._used_up_s))]  # it has been quiet for longest


def client_of(address: str) -> str:
    """The client of an address: the address itself, of IPv6 its whole /64."""
    parsed = numeric_address(address)
    return str(int(parsed) >> 64) if isinstance(parsed, ipaddress.IPv6Address) else address


def numeric_address(text: str) -> ipaddress.IPv4Address | ipaddress.IPv6Address | None:
    """The IP address in this text; None for a name, or for a socket of this machine."""
    try:
        return ipaddress.ip_address(text)
    except ValueError:
        return None
