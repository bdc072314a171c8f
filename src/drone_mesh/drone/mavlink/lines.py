"""Bytes to and from an autopilot: serial by pyserial, TCP and UDP by a socket."""

from __future__ import annotations

import errno
import select
import socket
from typing import Protocol

import serial

from drone_mesh.arguments import is_up_to
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
        """Accept the next peer that sends, if the line can have several."""

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
    """UDP: with `listens` the address is local and any peer may begin, else it is the peer's."""

    def __init__(self, host: str, port: int, listens: bool) -> None:
        """Raises OSError for an address that is not available."""
        self._listens = listens
        self._peer = None if listens else (host, port)
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self._socket.bind((host, port) if listens else ("", 0))
            if not listens:
                socket.gethostbyname(host)
        except OSError:
            self._socket.close()
            raise

    @property
    def port(self) -> int:
        """The port on this side."""
        return int(self._socket.getsockname()[1])

    def receive(self, timeout_s: float) -> bytes:
        if not select.select([self._socket], [], [], timeout_s)[0]:
            return b""
        data, peer = self._socket.recvfrom(MOST_BYTES)
        if self._peer is None:
            self._peer = peer  # the first to send; no other peer can take over the drone
        return data if peer == self._peer or self._is_peer(peer) else b""

    def send(self, data: bytes) -> None:
        if self._peer is not None:
            self._socket.sendto(data, self._peer)

    def forget_peer(self) -> None:
        if self._listens:
            self._peer = None

    def close(self) -> None:
        self._socket.close()

    def _is_peer(self, sender: tuple[str, int]) -> bool:
        peer = self._peer
        return peer is not None and (socket.gethostbyname(peer[0]), peer[1]) == sender


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
