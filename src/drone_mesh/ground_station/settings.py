"""GroundStationSettings: where ground stations are, and what they may do."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple, Sequence

from drone_mesh.arguments import is_up_to
from drone_mesh.errors import ConfigurationError, naming_argument
from drone_mesh.secret_file import read_secret
from drone_mesh.web.access import SHORTEST_TOKEN, is_loopback
from drone_mesh.web.listening import MAX_PORT


class Address(NamedTuple):
    """udp: messages are sent there, and its answers are read; tcp: stations connect to it."""

    kind: str
    host: str
    port: int


@dataclass(frozen=True)
class GroundStationSettings:
    """The addresses, and the rules for all of them."""

    stations: tuple[Address, ...] = ()
    cot: tuple[Address, ...] = ()  # where Cursor on Target goes
    may_order: bool = False
    key: bytes | None = None  # 32 bytes, of MAVLink 2 signing; None: nothing is signed

    @classmethod
    def parse(
        cls, stations: Sequence[str], cot: Sequence[str], may_order: bool, key_file: str
    ) -> GroundStationSettings:
        """From words of a user. Raises ConfigurationError."""
        if not stations and (may_order or key_file):
            raise ConfigurationError(
                "orders from ground stations and their key need --ground-station"
            )
        addresses = tuple(_address("--ground-station", text, ("udp", "tcp")) for text in stations)
        key = None
        if key_file:
            with naming_argument("--ground-station-key-file ", key_file):
                key = signing_key(Path(key_file))
        for text, (kind, host, _port) in zip(stations, addresses):
            if (may_order or kind == "tcp") and not (key or is_loopback(host)):
                raise ConfigurationError(
                    f"--ground-station {text}: other machines can reach it: orders and tcp need "
                    "--ground-station-key-file"
                )
        return cls(
            addresses, tuple(_address("--cot", text, ("udp",)) for text in cot), may_order, key
        )


NO_STATIONS = GroundStationSettings()


def signing_key(path: Path) -> bytes:
    """The key of a passphrase, as ground stations make it: its SHA-256. ConfigurationError."""
    passphrase = read_secret(path, "passphrase")
    if len(passphrase) < SHORTEST_TOKEN:
        raise ConfigurationError(f"{path}: must have at least {SHORTEST_TOKEN} characters")
    return hashlib.sha256(passphrase.encode()).digest()


def _address(option: str, text: str, kinds: Sequence[str]) -> Address:
    kind, _, rest = text.partition(":")
    host, _, port = rest.rpartition(":")
    if not (kind in kinds and host and is_up_to(port, MAX_PORT)):
        forms = " or ".join(f"{kind}:HOST:PORT" for kind in kinds)
        raise ConfigurationError(f"invalid {option} {text!r}: use {forms}")
    return Address(kind, host, int(port))
