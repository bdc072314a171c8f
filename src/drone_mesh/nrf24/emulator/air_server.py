"""AirServer: chips on an emulated air for other processes, which may come and go.

When a process ends for any reason, its chip loses its supply.
"""

from __future__ import annotations

import contextlib
import itertools
import logging
import socket
import struct
import threading

from drone_mesh.nrf24.emulator.air import Air
from drone_mesh.nrf24.emulator.air_protocol import (
    CHIP_NUMBER,
    MAKE_CHIP,
    TIMEOUT_S,
    Opcode,
    receive_request,
    send_answer,
)
from drone_mesh.nrf24.emulator.chip import EmulatedChip

MOST_CHIPS = 64  # more than one machine can emulate
LONGEST_WAIT_S = 1.0  # how often a thread that waits for an IRQ checks whether to end

_log = logging.getLogger(__name__)


class AirServer:
    """Accepts connections from creation to `close`; each connection has its own thread.

    `_lock` guards the chips and the connections; the clock guards the chips themselves.
    """

    def __init__(self, air: Air, host: str, port: int) -> None:
        """Raises OSError if the address is not available; port 0 is any free one."""
        self._air = air
        self._lock = threading.Lock()
        self._numbers = itertools.cycle(range(2**16))
        self._chips: dict[int, EmulatedChip] = {}
        self._connections: set[socket.socket] = set()
        self._threads: set[threading.Thread] = set()
        self._closed = False
        self._listener = socket.create_server((host, port))
        self.address: tuple[str, int] = self._listener.getsockname()[:2]
        self._accepting = threading.Thread(target=self._accept, name="air server", daemon=True)
        self._accepting.start()

    def close(self) -> None:
        """End all connections; returns when their threads have ended."""
        with self._lock:
            self._closed = True
            connections, threads = list(self._connections), list(self._threads)
        for end in (self._listener, *connections):
            with contextlib.suppress(OSError):
                end.shutdown(socket.SHUT_RDWR)
        self._listener.close()
        for thread in (self._accepting, *threads):
            thread.join()

    def _accept(self) -> None:
        while True:
            try:
                connection, _peer = self._listener.accept()
            except OSError:
                return
            connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            thread = threading.Thread(
                target=self._serve, args=(connection,), name="air client", daemon=True
            )
            with self._lock:
                if self._closed or len(self._connections) >= 2 * MOST_CHIPS:
                    connection.close()
                    continue
                self._connections.add(connection)
                self._threads.add(thread)
            thread.start()

    def _serve(self, connection: socket.socket) -> None:
        try:
            opcode, data = receive_request(connection)
            if opcode == Opcode.MAKE_CHIP:
                self._serve_chip(connection, data)
            elif opcode == Opcode.JOIN_CHIP:
                self._serve_irq(connection, data)
        except (OSError, KeyError, ValueError, struct.error) as error:
            _log.debug("emulated air: a connection ended: %s", error)
        finally:
            connection.close()
            with self._lock:
                self._connections.discard(connection)
                self._threads.discard(threading.current_thread())

    def _serve_chip(self, connection: socket.socket, data: bytes) -> None:
        x, y, z = MAKE_CHIP.unpack_from(data)
        name = data[MAKE_CHIP.size :].decode()
        chip = EmulatedChip(self._air, name, (x, y, z))
        with self._lock:
            number = next(free for free in self._numbers if free not in self._chips)
            self._chips[number] = chip
        _log.info("emulated air: %s joins at x %g, y %g, z %g m", name, x, y, z)
        try:
            send_answer(connection, CHIP_NUMBER.pack(number))
            while True:
                send_answer(connection, _carry_out(chip, *receive_request(connection)))
        finally:
            with self._lock:
                del self._chips[number]
            chip.ce.value = False
            chip.brown_out()
            _log.info("emulated air: %s is gone", name)

    def _serve_irq(self, connection: socket.socket, data: bytes) -> None:
        (number,) = CHIP_NUMBER.unpack(data)
        with self._lock:
            chip = self._chips[number]
        send_answer(connection, b"")
        while True:
            opcode, data = receive_request(connection)
            if opcode != Opcode.WAIT_IRQ:
                return
            (timeout_s,) = TIMEOUT_S.unpack(data)
            low = chip.irq.wait_low(max(0.0, min(timeout_s, LONGEST_WAIT_S)))
            send_answer(connection, bytes((low,)))


def _carry_out(chip: EmulatedChip, opcode: int, data: bytes) -> bytes:
    """Raises ValueError or struct.error for an invalid request."""
    if opcode == Opcode.TRANSFER:
        if not data:
            raise ValueError("invalid transfer: must have at least one byte")
        return bytes(chip.spi.xfer2(data))
    if opcode == Opcode.SET_CE:
        chip.ce.value = data == b"\1"
    elif opcode == Opcode.MOVE:
        chip.position = MAKE_CHIP.unpack(data)
    else:
        raise ValueError(f"invalid opcode {opcode}")
    return b""
