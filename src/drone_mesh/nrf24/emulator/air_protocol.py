"""The TCP protocol between a process and the server of an emulated air.

A request is an opcode, the length of its data and the data; the answer is the length of its data
and the data. A connection carries one request at a time. The first connection of a process creates
its chip; a second one waits for the chip's IRQ pin, because waiting blocks a connection.
"""

from __future__ import annotations

import enum
import socket
import struct

MAKE_CHIP = struct.Struct("<ddd")  # position in metres; the chip's name follows, UTF-8
CHIP_NUMBER = struct.Struct("<H")
TIMEOUT_S = struct.Struct("<f")


class Opcode(enum.IntEnum):
    """The kinds of requests."""

    MAKE_CHIP = 1  # answered with the chip's number
    JOIN_CHIP = 2  # for its IRQ; answered with nothing
    TRANSFER = 3  # SPI; answered with as many bytes
    SET_CE = 4  # one byte, 0 or 1; answered with nothing
    MOVE = 5  # to a position; answered with nothing
    WAIT_IRQ = 6  # for so many seconds at most; answered with one byte, 1: it is low


def send_request(connection: socket.socket, opcode: int, data: bytes) -> None:
    """Raises OSError; ValueError for more than 255 bytes."""
    connection.sendall(bytes((opcode, len(data))) + data)


def receive_request(connection: socket.socket) -> tuple[int, bytes]:
    """Opcode and data. Raises OSError, also when the other side has closed the connection."""
    opcode, length = _receive(connection, 2)
    return opcode, _receive(connection, length)


def send_answer(connection: socket.socket, data: bytes) -> None:
    """Raises OSError; ValueError for more than 255 bytes."""
    connection.sendall(bytes((len(data),)) + data)


def receive_answer(connection: socket.socket) -> bytes:
    """Raises OSError, also when the other side has closed the connection."""
    return _receive(connection, _receive(connection, 1)[0])


def _receive(connection: socket.socket, length: int) -> bytes:
    received = b""
    while len(received) < length:
        more = connection.recv(length - len(received))
        if not more:
            raise ConnectionResetError("the other side has closed the connection")
        received += more
    return received
