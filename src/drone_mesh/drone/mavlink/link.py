"""The line to an autopilot: serial, UDP or TCP, by pymavlink's connections."""

from __future__ import annotations

import logging
import time
from typing import Any

from pymavlink import mavutil
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from drone_mesh.drone.mavlink.autopilots import OUR_SYSTEM_ID
from drone_mesh.drone.mavlink.telemetry import Message
from drone_mesh.errors import ConfigurationError

DEFAULT_BAUD = 57600  # of telemetry ports, of both autopilots
OPEN_AGAIN_S = 2.0  # our choice: how often a line that broke is tried
MOST_BYTES = 4096  # of one reading
NETWORK_KINDS = ("udpin", "udpout", "tcp")
_BAD_DATA = "BAD_DATA"

_log = logging.getLogger(__name__)


def parse_address(text: str) -> tuple[str, int]:
    """Device and baud rate (0: none) of "/dev/serial0,921600" or "udpin:0.0.0.0:14550"."""
    kind, _, rest = text.partition(":")
    if kind in NETWORK_KINDS:
        host, _, port = rest.rpartition(":")
        if host and port.isdecimal() and 1 <= int(port) <= 65535:
            return text, 0
    elif text.startswith("/"):
        device, comma, baud = text.partition(",")
        if not comma:
            return device, DEFAULT_BAUD
        if baud.isdecimal() and int(baud) > 0:
            return device, int(baud)
    raise ConfigurationError(
        f"invalid MAVLink address {text!r}: use /dev/NAME,BAUD or udpin:HOST:PORT, "
        "udpout:HOST:PORT, tcp:HOST:PORT"
    )


class MavlinkLink:
    """Opens the line, and again whenever it breaks. One thread uses it."""

    def __init__(self, address: str) -> None:
        """Raises ConfigurationError if the address is wrong or the line cannot be had."""
        self._address = address
        self._device, self._baud = parse_address(address)
        self._codec = mavlink.MAVLink(None, OUR_SYSTEM_ID, mavlink.MAV_COMP_ID_ONBOARD_COMPUTER)
        self._codec.robust_parsing = True  # noise is normal: skip it
        self._open_again_s = 0.0
        try:
            self._line: Any = self._open()
        except (OSError, ValueError) as error:  # SerialException is an OSError
            raise ConfigurationError(f"MAVLink address {address}: {error}") from error

    def receive(self, timeout_s: float) -> list[Message]:
        """The messages that arrive within this time, as soon as there are some."""
        if self._line is None:
            time.sleep(timeout_s)
            self._try_to_open()
            return []
        try:
            if not self._line.select(timeout_s):
                return []
            data = self._line.recv(MOST_BYTES)
        except (OSError, TypeError) as error:  # pyserial raises TypeError when closed under it
            self._broke(error)
            return []
        messages = self._codec.parse_buffer(data) if data else None
        return [m for m in messages or () if m.get_type() != _BAD_DATA]

    def send(self, message: Message) -> None:
        """Bring it onto the line; lost if that is broken."""
        if self._line is None:
            return
        try:
            self._line.write(message.pack(self._codec))
            self._codec.seq = (self._codec.seq + 1) % 256
        except (OSError, TypeError) as error:
            self._broke(error)

    def close(self) -> None:
        """Give the line back."""
        if self._line is not None:
            self._line.close()
            self._line = None

    def _open(self) -> Any:
        options: dict[str, Any] = {"source_system": OUR_SYSTEM_ID, "dialect": "ardupilotmega"}
        if self._baud:
            options["baud"] = self._baud
        elif self._device.startswith("tcp:"):
            options["retries"] = 1
        return mavutil.mavlink_connection(self._device, **options)

    def _broke(self, error: Exception) -> None:
        _log.warning("MAVLink %s broke: %s; trying again", self._address, error)
        self.close()
        self._open_again_s = time.monotonic() + OPEN_AGAIN_S

    def _try_to_open(self) -> None:
        if time.monotonic() < self._open_again_s:
            return
        try:
            self._line = self._open()
            _log.info("MAVLink %s is open again", self._address)
        except (OSError, ValueError):
            self._open_again_s = time.monotonic() + OPEN_AGAIN_S
