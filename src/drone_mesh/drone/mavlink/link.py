"""MavlinkLink: messages over a line that may break and is opened again."""

from __future__ import annotations

import logging
import time

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from drone_mesh.drone.mavlink.autopilots import OUR_SYSTEM_ID
from drone_mesh.drone.mavlink.lines import Line, open_line
from drone_mesh.drone.mavlink.telemetry import Message
from drone_mesh.errors import ConfigurationError

MOST_READINGS = 500  # of datagrams that waited; more than ten seconds of all reports
SILENT_S = 10.0  # after this silence a peer on another port is accepted
OPEN_AGAIN_S = 2.0  # period of attempts to open a broken line
_BAD_DATA = "BAD_DATA"

_log = logging.getLogger(__name__)


class MavlinkLink:
    """Opens the line, and reopens it whenever it breaks. One thread uses it."""

    def __init__(self, address: str) -> None:
        """Raises ConfigurationError if the address is invalid or the line not available."""
        self._address = address
        self._codec = mavlink.MAVLink(None, OUR_SYSTEM_ID, mavlink.MAV_COMP_ID_ONBOARD_COMPUTER)
        self._codec.robust_parsing = True  # noise is normal: skip it
        self._open_again_s = 0.0
        self._heard_s = time.monotonic()
        try:
            self._line: Line | None = open_line(address)
        except OSError as error:
            raise ConfigurationError(f"MAVLink address {address}: {error}") from error

    def receive(self, timeout_s: float) -> list[Message]:
        """Wait up to this time for messages; returns all that wait as soon as there are some."""
        if self._line is None:
            time.sleep(timeout_s)
            self._try_to_open()
            return []
        data = self._read_all(self._line, timeout_s)
        now_s = time.monotonic()
        if data:
            self._heard_s = now_s
        elif now_s - self._heard_s > SILENT_S and self._line is not None:
            self._heard_s = now_s
            self._line.forget_peer()
        messages = self._codec.parse_buffer(data) if data else None
        return [m for m in messages or () if m.get_type() != _BAD_DATA]

    def send(self, message: Message) -> None:
        """Send a message; it is lost if the line is broken."""
        if self._line is None:
            return
        try:
            self._line.send(message.pack(self._codec))
            self._codec.seq = (self._codec.seq + 1) % 256
        except OSError as error:
            self._broke(error)

    def close(self) -> None:
        """Close the line."""
        if self._line is not None:
            self._line.close()
            self._line = None

    def _read_all(self, line: Line, timeout_s: float) -> bytes:
        """Read all messages that wait; a newer report replaces an older one of its kind."""
        data = b""
        try:
            for _ in range(MOST_READINGS):
                more = line.receive(0.0 if data else timeout_s)
                if not more:
                    break
                data += more
        except OSError as error:
            self._broke(error)
        return data

    def _broke(self, error: Exception) -> None:
        _log.warning("MAVLink %s broke: %s; trying again", self._address, error)
        self.close()
        self._open_again_s = time.monotonic() + OPEN_AGAIN_S

    def _try_to_open(self) -> None:
        if time.monotonic() < self._open_again_s:
            return
        try:
            self._line = open_line(self._address)
            _log.info("MAVLink %s is open again", self._address)
        except OSError:
            self._open_again_s = time.monotonic() + OPEN_AGAIN_S
