"""The chip's SPI commands as functions, with named registers."""

from __future__ import annotations

from typing import Mapping

from drone_mesh.nrf24.errors import RadioError
from drone_mesh.nrf24.registers import Command, Register
from drone_mesh.nrf24.spi import SpiDevice

_NO_CHIP = (0x00, 0xFF)  # STATUS if nothing drives MISO, or nothing is connected


class ChipLink:
    """One chip on one SPI device; the caller ensures that one thread at a time uses it."""

    def __init__(self, spi: SpiDevice) -> None:
        self._spi = spi
        self.status = 0  # as of the last command, before it acted

    def command(self, command: int, data: bytes = b"") -> bytes:
        """One transfer; returns the bytes after STATUS. RadioError if no chip answers."""
        try:
            answer = self._spi.xfer2([command, *data])
        except OSError as error:
            raise RadioError(f"SPI does not work: {error.strerror or error}") from error
        self.status = answer[0]
        if self.status in _NO_CHIP:
            raise RadioError(
                f"no nRF24L01+ answers on SPI (STATUS reads 0x{self.status:02X}): "
                "check the wiring, CSN and the 3.3 V supply"
            )
        return bytes(answer[1:])

    def read(self, register: Register, count: int = 1) -> bytes:
        """R_REGISTER; multi-byte values LSByte first."""
        return self.command(Command.R_REGISTER | register, bytes(count))

    def read_byte(self, register: Register) -> int:
        """R_REGISTER of a register of one byte."""
        return self.command(Command.R_REGISTER | register, b"\0")[0]

    def write(self, register: Register, value: bytes) -> None:
        """W_REGISTER."""
        self.command(Command.W_REGISTER | register, value)

    def write_byte(self, register: Register, value: int) -> None:
        """W_REGISTER of a register of one byte."""
        self.command(Command.W_REGISTER | register, bytes((value,)))

    def write_and_verify(self, values: Mapping[Register, bytes]) -> None:
        """Write registers and read each back; RadioError names the one that differs."""
        for register, value in values.items():
            self.write(register, value)
        wrong = self.first_difference(values)
        if wrong is not None:
            register, found = wrong
            raise RadioError(
                f"{register.name} was written as {values[register].hex()} and reads as "
                f"{found.hex()}: check wiring and supply, or use a slower SPI clock"
            )

    def first_difference(self, values: Mapping[Register, bytes]) -> tuple[Register, bytes] | None:
        """The first register that does not hold its value, with the value found, or None."""
        for register, value in values.items():
            found = self.read(register, len(value))
            if found != value:
                return register, found
        return None
