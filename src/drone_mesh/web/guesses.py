"""Slows down clients that guess tokens."""

from __future__ import annotations

import ipaddress
import time
from typing import Callable

FREE_GUESSES = 10  # our choice: an old cookie or a typing error costs no time
GUESS_PERIOD_S = 1.0  # our choice: of further wrong tokens of one address
MOST_ADDRESSES = 1024


class GuessLimit:
    """Limits wrong tokens per address, of IPv6 per /64. One thread at a time."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._used_up_s: dict[str, float] = {}  # by client: until then its guesses count

    def is_over(self, address: str) -> bool:
        """Whether this address has to wait; until then its tokens are not even compared."""
        until_s = self._used_up_s.get(_client(address), 0.0)
        return until_s - self._clock() > (FREE_GUESSES - 1) * GUESS_PERIOD_S

    def note_wrong(self, address: str) -> None:
        """A wrong token came from this address."""
        now_s = self._clock()
        client = _client(address)
        until_s = max(now_s, self._used_up_s.pop(client, 0.0))
        self._used_up_s[client] = until_s + GUESS_PERIOD_S
        if len(self._used_up_s) > MOST_ADDRESSES:
            del self._used_up_s[next(iter(self._used_up_s))]  # its latest guess is the oldest


def _client(address: str) -> str:
    try:
        parsed = ipaddress.ip_address(address)
    except ValueError:  # a socket of this machine
        return address
    if isinstance(parsed, ipaddress.IPv6Address):
        return str(int(parsed) >> 64)
    return address
