"""MavlinkLink: messages over a line that may break; lines: serial by pyserial, TCP and UDP."""

from __future__ import annotations

import contextlib
import errno
import logging
import select
import socket
import termios
import time
from typing import Protocol

import serial
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from drone_mesh.arguments import is_up_to
from drone_mesh.drone.mavlink.autopilots import OUR_SYSTEM_ID
from drone_mesh.drone.mavlink.telemetry import Message
from drone_mesh.errors import ConfigurationError

DEFAULT_BAUD = 57600  # of telemetry ports, of both autopilots
MOST_BYTES = 4096  # of one reading
HIGHEST_BAUD = 4_000_000  # of termios
SENT_WITHIN_S = 0.5  # a telemetry port sends a message within 50 ms
CONNECTED_WITHIN_S = 5.0  # also the time for sending


class Line(Protocol):
    """A connection for bytes. Any function raises OSError when the connection is broken."""

    def receive(self, timeout_s: float) -> bytes:
        """Wait up to this time for data; returns as soon as there is some."""

    def send(self, data: bytes) -> None:
        """Send these bytes."""

    def forget_peer(self) -> None:
        """Accept another peer, if the line can have one."""

    def close(self) -> None:
        """Close the connection."""


class SerialLine:
    """A serial port, which no other program may use: each would read a part of what arrives."""

    def __init__(self, device: str, baud: int) -> None:
        """Raises OSError."""
        try:
            self._port = serial.Serial(
                device, baudrate=baud, exclusive=True, write_timeout=SENT_WITHIN_S
            )
        except serial.SerialException as error:
            if error.errno == errno.EAGAIN:
                raise OSError("another program uses the port; is a node running?") from error
            raise
        except termios.error as error:  # it vanished meanwhile; this one is no OSError
            raise OSError(*error.args) from error

    def receive(self, timeout_s: float) -> bytes:
        self._port.timeout = timeout_s
        first = self._port.read(1)
        waiting = min(self._port.in_waiting, MOST_BYTES) if first else 0
        return bytes(first + self._port.read(waiting) if waiting else first)

    def send(self, data: bytes) -> None:
        self._port.write(data)

    def forget_peer(self) -> None:
        """Does nothing: there is only one peer."""

    def close(self) -> None:
        self._port.close()


class TcpLine:
    """A TCP connection to a listening autopilot."""

    def __init__(self, host: str, port: int) -> None:
        """Raises OSError."""
        self._socket = socket.create_connection((host, port), CONNECTED_WITHIN_S)
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

    def receive(self, timeout_s: float) -> bytes:
        if not select.select([self._socket], [], [], timeout_s)[0]:
            return b""
        data = self._socket.recv(MOST_BYTES)
        if not data:
            raise ConnectionResetError("the other side has closed the connection")
        return data

    def send(self, data: bytes) -> None:
        self._socket.sendall(data)

    def forget_peer(self) -> None:
        """Does nothing: there is only one peer."""

    def close(self) -> None:
        self._socket.close()


class UdpLine:
    """UDP: with `listens` the address is local and any peer may begin, else it is the peer's.

    The name of a peer is looked up only here and after a silence: a name server that does not
    answer would keep the drone from its targets.
    """

    def __init__(self, host: str, port: int, listens: bool) -> None:
        """Raises OSError for an address that is not available."""
        self._host = host
        self._listens = listens
        self._peer: tuple[str, int] | None = None
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self._socket.bind((host, port) if listens else ("", 0))
            if not listens:
                self._peer = socket.gethostbyname(host), port
        except OSError:
            self._socket.close()
            raise

    @property
    def port(self) -> int:
        return int(self._socket.getsockname()[1])

    def receive(self, timeout_s: float) -> bytes:
        if not select.select([self._socket], [], [], timeout_s)[0]:
            return b""
        data, peer = self._socket.recvfrom(MOST_BYTES)
        if self._peer is None:
            self._peer = peer  # the first to send; no other peer can take over the drone
        return data if peer == self._peer else b""

    def send(self, data: bytes) -> None:
        if self._peer is not None:
            self._socket.sendto(data, self._peer)

    def forget_peer(self) -> None:
        if self._listens:
            self._peer = None
        elif self._peer is not None:
            with contextlib.suppress(OSError):  # its name may have another address now
                self._peer = socket.gethostbyname(self._host), self._peer[1]

    def close(self) -> None:
        self._socket.close()


def parse_address(text: str) -> tuple[str, str, int]:
    """Kind, host or device, and port or baud rate.

    "/dev/serial0,921600" or "udpin:0.0.0.0:14550". Raises ConfigurationError.
    """
    kind, _, rest = text.partition(":")
    if kind in ("udpin", "udpout", "tcp"):
        host, _, port = rest.rpartition(":")
        if host and is_up_to(port, 65535) and int(port) > 0:
            return kind, host, int(port)
    elif text.startswith("/"):
        device, comma, baud = text.partition(",")
        if not comma:
            return "serial", device, DEFAULT_BAUD
        if is_up_to(baud, HIGHEST_BAUD) and int(baud) > 0:
            return "serial", device, int(baud)
    raise ConfigurationError(
        f"invalid MAVLink address {text!r}: use /dev/NAME,BAUD or udpin:HOST:PORT, "
        "udpout:HOST:PORT, tcp:HOST:PORT"
    )


def open_line(address: str) -> Line:
    """Raises ConfigurationError for an invalid address, OSError if it is not available."""
    kind, place, number = parse_address(address)
    if kind == "serial":
        return SerialLine(place, number)
    if kind == "tcp":
        return TcpLine(place, number)
    return UdpLine(place, number, listens=kind == "udpin")


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
