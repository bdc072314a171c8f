"""An emulated air for several processes: AirServer serves it, RemoteChip is a chip on it.

A TCP connection is one chip; when it ends for any reason, the chip loses its supply. A request is
an opcode, the length of its data and the data; the answer is the length of its data and the data.
The first request creates the chip. The IRQ pin is not served: such a chip is polled.
"""

from __future__ import annotations

import contextlib
import enum
import logging
import socket
import socketserver
import struct
import threading
import time
from typing import Any, Sequence

from drone_mesh.nrf24.emulator.air import Air
from drone_mesh.nrf24.emulator.chip import EmulatedChip
from drone_mesh.nrf24.emulator.space import Position

MOST_CHIPS = 64  # more than one machine can emulate
ANSWER_WITHIN_S = 5.0  # far above what a busy machine takes
CONNECT_AGAIN_S = 1.0
_POLL_S = 0.1  # how soon the accepting thread notices the end
_PLACE = struct.Struct("<ddd")  # metres

_log = logging.getLogger(__name__)


class Opcode(enum.IntEnum):
    """The kinds of requests."""

    MAKE_CHIP = 1  # position, then the chip's name in UTF-8; answered with nothing
    TRANSFER = 2  # SPI; answered with as many bytes
    SET_CE = 3  # one byte, 0 or 1; answered with nothing
    MOVE = 4  # to a position; answered with nothing


def _receive(connection: socket.socket, length: int) -> bytes:
    """Raises OSError, also when the other side has closed the connection."""
    received = b""
    while len(received) < length:
        more = connection.recv(length - len(received))
        if not more:
            raise ConnectionResetError("the other side has closed the connection")
        received += more
    return received


class AirServer(socketserver.ThreadingTCPServer):
    """Accepts connections from creation to `close`; each has its own thread.

    The accepting thread adds connections, and each thread removes its own.
    """

    allow_reuse_address = True
    request_queue_size = MOST_CHIPS

    def __init__(self, air: Air, host: str, port: int) -> None:
        """Raises OSError if the address is not available; port 0 is any free one."""
        self.air = air
        self._connections: set[Any] = set()
        super().__init__((host, port), _Client)
        self.address: tuple[str, int] = self.socket.getsockname()[:2]
        self._accepting = threading.Thread(
            target=self.serve_forever, args=(_POLL_S,), name="air server", daemon=True
        )
        self._accepting.start()

    def close(self) -> None:
        """End all connections; returns when their threads have ended."""
        self.shutdown()
        self._accepting.join()
        for connection in tuple(self._connections):
            with contextlib.suppress(OSError):
                connection.shutdown(socket.SHUT_RDWR)
        self.server_close()

    def verify_request(self, request: Any, client_address: Any) -> bool:
        """Whether there is room for one more chip."""
        self._connections.add(request)
        return len(self._connections) <= MOST_CHIPS

    def shutdown_request(self, request: Any) -> None:
        self._connections.discard(request)
        super().shutdown_request(request)


class _Client(socketserver.BaseRequestHandler):
    server: AirServer

    def handle(self) -> None:
        self.request.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        try:
            opcode, data = self._next()
            if opcode == Opcode.MAKE_CHIP:
                self._serve(_PLACE.unpack_from(data), data[_PLACE.size :].decode())
        except (OSError, ValueError, struct.error) as error:
            _log.debug("emulated air: a connection ended: %s", error)

    def _serve(self, place: tuple[Any, ...], name: str) -> None:
        x, y, z = place
        chip = EmulatedChip(self.server.air, name, (x, y, z))
        _log.info("emulated air: %s joins at x %g, y %g, z %g m", name, x, y, z)
        try:
            answer = b""
            while True:
                self.request.sendall(bytes((len(answer),)) + answer)
                answer = _carry_out(chip, *self._next())
        finally:
            chip.ce.value = False
            chip.brown_out()
            _log.info("emulated air: %s is gone", name)

    def _next(self) -> tuple[int, bytes]:
        opcode, length = _receive(self.request, 2)
        return opcode, _receive(self.request, length)


def _carry_out(chip: EmulatedChip, opcode: int, data: bytes) -> bytes:
    """Raises ValueError or struct.error for an invalid request."""
    if opcode == Opcode.TRANSFER and data:
        return bytes(chip.spi.xfer2(data))
    if opcode == Opcode.SET_CE:
        chip.ce.value = data == b"\1"
    elif opcode == Opcode.MOVE:
        chip.position = _PLACE.unpack(data)
    else:
        raise ValueError(f"invalid request {opcode}, {len(data)} bytes")
    return b""


class RemoteChip:
    """An emulated chip on an air in another process: an SpiDevice, with its CE. Any thread.

    After a lost connection the chip does not answer: the driver reports this and retries, and gets
    a new chip as soon as the air is served again. `_lock` is held during a request.
    """

    def __init__(self, host: str, port: int, name: str, position: Position) -> None:
        """Connect. Raises OSError if the air is not served there."""
        self._address = (host, port)
        self._name = name
        self._position = position
        self._lock = threading.Lock()
        self._connection: socket.socket | None = None
        self._tried_s = 0.0  # when it was lost, or to be opened; of the machine's clock
        self._closed = False
        with self._lock:
            self._connect()
        self.ce = RemoteCe(self)

    def xfer2(self, data: Sequence[int]) -> list[int]:
        """Clock out `data` and return the bytes received. Raises OSError."""
        return list(self.request(Opcode.TRANSFER, bytes(data)))

    def move(self, position: Position) -> None:
        if position != self._position:
            self._position = position
            with contextlib.suppress(OSError):  # the next chip is created there
                self.request(Opcode.MOVE, _PLACE.pack(*position))

    def close(self) -> None:
        """Release the chip; it loses its supply."""
        with self._lock:
            self._closed = True
            self._hang_up()

    def request(self, opcode: int, data: bytes) -> bytes:
        """The chip's answer. Raises OSError while the air cannot be reached."""
        with self._lock:
            if self._connection is None:
                if self._closed or time.monotonic() - self._tried_s < CONNECT_AGAIN_S:
                    raise ConnectionError("the emulated air is gone")
                self._connect()
            return self._ask(opcode, data)

    def _connect(self) -> None:
        self._tried_s = time.monotonic()
        self._connection = socket.create_connection(self._address, ANSWER_WITHIN_S)
        self._connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._ask(Opcode.MAKE_CHIP, _PLACE.pack(*self._position) + self._name.encode())

    def _ask(self, opcode: int, data: bytes) -> bytes:
        assert self._connection is not None
        try:
            self._connection.sendall(bytes((opcode, len(data))) + data)
            return _receive(self._connection, _receive(self._connection, 1)[0])
        except OSError:
            self._hang_up()
            raise

    def _hang_up(self) -> None:
        self._tried_s = time.monotonic()
        if self._connection is not None:
            self._connection.close()
            self._connection = None


class RemoteCe:
    """A CePin."""

    def __init__(self, chip: RemoteChip) -> None:
        self._chip = chip
        self._value = False

    @property
    def value(self) -> bool:
        return self._value

    @value.setter
    def value(self, high: bool) -> None:
        self._value = high
        with contextlib.suppress(OSError):  # as a pin that is not wired; SPI reports the loss
            self._chip.request(Opcode.SET_CE, bytes((high,)))

    def close(self) -> None:
        """Nothing to release."""
