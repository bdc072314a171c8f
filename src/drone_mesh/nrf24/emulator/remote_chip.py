"""RemoteChip: an emulated chip on an air in another process, with its SPI, CE and IRQ.

After a lost connection the chip does not answer: the driver reports this and retries, and gets a
new chip as soon as the air is served again.
"""

from __future__ import annotations

import contextlib
import socket
import threading
import time
from typing import Sequence

from drone_mesh.nrf24.emulator.air_protocol import (
    CHIP_NUMBER,
    MAKE_CHIP,
    TIMEOUT_S,
    Opcode,
    receive_answer,
    send_request,
)
from drone_mesh.nrf24.emulator.fading import Position

ANSWER_WITHIN_S = 5.0  # far above what a busy machine takes
CONNECT_AGAIN_S = 1.0


class _Connection:
    """One connection to the air, for one thread at a time; closed after each failure."""

    def __init__(self, address: tuple[str, int]) -> None:
        self._address = address
        self._socket: socket.socket | None = None
        self.closed_s = 0.0  # when it was closed, of the machine's clock

    @property
    def is_open(self) -> bool:
        return self._socket is not None

    def open(self, opcode: Opcode, data: bytes) -> bytes:
        """Connect again; the answer to the first request. Raises OSError."""
        self.close()
        try:
            self._socket = socket.create_connection(self._address, ANSWER_WITHIN_S)
            self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        except OSError:
            self.close()
            raise
        return self.ask(opcode, data)

    def ask(self, opcode: Opcode, data: bytes) -> bytes:
        """The answer to a request. Raises OSError."""
        assert self._socket is not None
        try:
            send_request(self._socket, opcode, data)
            return receive_answer(self._socket)
        except OSError:
            self.close()
            raise

    def close(self) -> None:
        self.closed_s = time.monotonic()
        if self._socket is not None:
            self._socket.close()
            self._socket = None

    def interrupt(self) -> None:
        """End a request that is under way. Any thread."""
        waiting = self._socket
        if waiting is not None:
            with contextlib.suppress(OSError):
                waiting.shutdown(socket.SHUT_RDWR)


class RemoteChip:
    """Any thread; `_lock` is held during a request, `_irq_lock` while one thread waits for IRQ."""

    def __init__(self, host: str, port: int, name: str, position: Position) -> None:
        """Connect. Raises OSError if the air is not served there."""
        self._name = name
        self._position = position
        self._lock = threading.Lock()
        self._irq_lock = threading.Lock()
        self._requests = _Connection((host, port))
        self._irq_waits = _Connection((host, port))
        self._number = self._irq_number = -1  # of the chip, and of that whose IRQ is waited for
        self._closed = False
        with self._lock:
            self._connect()
        self.spi = RemoteSpi(self)
        self.ce = RemoteCe(self)
        self.irq = RemoteIrq(self)

    def request(self, opcode: Opcode, data: bytes) -> bytes:
        """The chip's answer. Raises OSError while the air cannot be reached."""
        with self._lock:
            if not self._requests.is_open:
                if self._closed or time.monotonic() - self._requests.closed_s < CONNECT_AGAIN_S:
                    raise ConnectionError("the emulated air is gone")
                self._connect()
            return self._requests.ask(opcode, data)

    def wait_irq(self, timeout_s: float) -> bool:
        """Wait until IRQ is low, at most this long or a second. Whether it is. Raises OSError."""
        with self._irq_lock:
            if self._closed:
                raise ConnectionError("this chip was released")
            if not self._irq_waits.is_open or self._irq_number != self._number:
                self._irq_number = self._number
                self._irq_waits.open(Opcode.JOIN_CHIP, CHIP_NUMBER.pack(self._irq_number))
            return self._irq_waits.ask(Opcode.WAIT_IRQ, TIMEOUT_S.pack(timeout_s)) == b"\1"

    def move(self, position: Position) -> None:
        """Move the chip to this position."""
        if position != self._position:
            self._position = position
            with contextlib.suppress(OSError):  # the next chip is created there
                self.request(Opcode.MOVE, MAKE_CHIP.pack(*position))

    def close(self) -> None:
        """Release the chip; it loses its supply."""
        with self._lock:
            self._closed = True
            self._requests.close()
        self._irq_waits.interrupt()
        with self._irq_lock:
            self._irq_waits.close()

    def _connect(self) -> None:
        place = MAKE_CHIP.pack(*self._position)
        answer = self._requests.open(Opcode.MAKE_CHIP, place + self._name.encode())
        (self._number,) = CHIP_NUMBER.unpack(answer)


class RemoteSpi:
    """A SpiDevice."""

    def __init__(self, chip: RemoteChip) -> None:
        self._chip = chip

    def xfer2(self, data: Sequence[int]) -> list[int]:
        """Clock out `data` and return the bytes received. Raises OSError."""
        return list(self._chip.request(Opcode.TRANSFER, bytes(data)))

    def close(self) -> None:
        """Release the chip."""
        self._chip.close()


class RemoteCe:
    """A CePin."""

    def __init__(self, chip: RemoteChip) -> None:
        self._chip = chip
        self._value = False

    @property
    def value(self) -> bool:
        """The level of the pin."""
        return self._value

    @value.setter
    def value(self, high: bool) -> None:
        self._value = high
        with contextlib.suppress(OSError):  # as a pin that is not wired; SPI reports the loss
            self._chip.request(Opcode.SET_CE, bytes((high,)))

    def close(self) -> None:
        """Nothing to release."""


class RemoteIrq:
    """An IrqPin."""

    def __init__(self, chip: RemoteChip) -> None:
        self._chip = chip

    def wait_low(self, timeout_s: float) -> bool:
        """Wait until it is low; False if it is still high after the time-out."""
        until_s = time.monotonic() + timeout_s
        while True:
            left_s = until_s - time.monotonic()
            try:
                if self._chip.wait_irq(max(0.0, left_s)):
                    return True
            except OSError:
                time.sleep(max(0.0, min(left_s, CONNECT_AGAIN_S)))
            if left_s <= 0.0:
                return False

    def close(self) -> None:
        """Nothing to release."""
