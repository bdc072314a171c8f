"""Access rules of the web servers.

Without a token a server listens on the loopback interface only and answers only requests to
loopback names, which defeats DNS rebinding. With a token, any client that presents it may connect.
In both cases a WebSocket is accepted only from the page that this server sent.
"""

from __future__ import annotations

import hmac
import ipaddress
import socket
import threading
import time
from dataclasses import dataclass, field
from typing import Callable, Iterable
from urllib.parse import SplitResult, urlsplit

from drone_mesh.errors import ConfigurationError, MeshError
from drone_mesh.web import LOOPBACK

MOST_CLIENTS = 1024
SHORTEST_TOKEN = 16  # characters; too long to be guessed over a network
FREE_GUESSES = 10  # an old cookie or a typing error costs no time
GUESS_PERIOD_S = 1.0  # of further wrong tokens of one address


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
        with self._lock:
            until_s = max(self._clock(), self._used_up_s.pop(client, 0.0))
            self._used_up_s[client] = until_s + self._period_s
            if len(self._used_up_s) > MOST_CLIENTS:
                del self._used_up_s[next(iter(self._used_up_s))]  # it has been quiet for longest


def client_of(address: str) -> str:
    """The client of an address: the address itself, of IPv6 its whole /64.

    On a socket for both protocols, an IPv4 address comes as one of IPv6: all in a single /64.
    """
    parsed = numeric_address(address)
    if not isinstance(parsed, ipaddress.IPv6Address):
        return address
    return str(parsed.ipv4_mapped or int(parsed) >> 64)


def numeric_address(text: str) -> ipaddress.IPv4Address | ipaddress.IPv6Address | None:
    """The IP address in this text; None for a name, or for a socket of this machine."""
    try:
        return ipaddress.ip_address(text)
    except ValueError:
        return None


class AccessDenied(MeshError):
    """A refused request; the text gives the reason."""


class TooManyGuesses(AccessDenied):
    """The address sent too many wrong tokens and has to wait."""


@dataclass(frozen=True)
class Access:
    """The rules of one server. Without a token it answers only to loopback names.

    With a token it answers to `names` and to all numeric addresses, which cannot be rebound. If
    `names` is empty, it answers to any name.
    """

    token: str | None = None
    names: frozenset[str] = frozenset()
    guesses: Allowance = field(
        default_factory=lambda: Allowance(FREE_GUESSES, GUESS_PERIOD_S), compare=False, repr=False
    )

    def check_host(self, host: str) -> None:
        """Check the Host header. Raises AccessDenied."""
        name = _parts(f"//{host}").hostname or ""
        if self.token is None:
            if not is_loopback(name):
                raise AccessDenied(f"{host!r} is not a loopback name of this machine")
        elif self.names and name.lower() not in self.names and numeric_address(name) is None:
            raise AccessDenied(f"{host!r} is not a name of this machine; --name adds one")

    def check_origin(self, origin: str | None, host: str) -> None:
        """Check the Origin header: the requesting page must be ours. Raises AccessDenied."""
        if origin is None or _parts(origin).netloc.lower() != host.lower():
            raise AccessDenied(
                f"the page {origin or 'without an origin'} was not sent by this server"
            )

    def is_right(self, token: str | None, address: str) -> bool:
        """Whether this token of a client at `address` is right, or none is needed.

        Raises TooManyGuesses.
        """
        if self.token is None:
            return True
        if not token:
            return False
        client = client_of(address)
        if self.guesses.is_over(client):  # otherwise the answer to a right token would tell
            raise TooManyGuesses(f"too many wrong tokens from {address}: try again in a second")
        if hmac.compare_digest(token.encode(), self.token.encode()):
            return True
        self.guesses.note(client)
        return False


def access_for(bind_address: str, token: str, names: Iterable[str] = ()) -> Access:
    """The rules for a server that listens on this address; an empty token means none.

    `names`: host names that it answers to besides numeric addresses; none: any, with a token.
    """
    if token and len(token) < SHORTEST_TOKEN:
        raise ConfigurationError(f"token: must have at least {SHORTEST_TOKEN} characters")
    if not token and not is_loopback(bind_address):
        raise ConfigurationError(
            f"address {bind_address}: other machines can reach it; set a token, or use {LOOPBACK}"
        )
    return Access(token or None, frozenset(name.lower() for name in names))


def own_names(*more: str) -> frozenset[str]:
    """The names of this machine, and `more`."""
    name = socket.gethostname().lower()
    return frozenset({"localhost", name, f"{name}.local", *(other.lower() for other in more)})


def is_loopback(name: str) -> bool:
    address = numeric_address(name)
    return name.lower() == "localhost" or (address is not None and address.is_loopback)


def _parts(address: str) -> SplitResult:
    """The parts of an address; all are empty if it is none."""
    try:
        return urlsplit(address)
    except ValueError:
        return urlsplit("")
