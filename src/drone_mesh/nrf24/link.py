"""The chip's SPI commands as functions, with named registers."""

from __future__ import annotations

from typing import Iterator, Mapping

from drone_mesh.nrf24.errors import RadioError
from drone_mesh.nrf24.pins import SpiDevice
from drone_mesh.nrf24.registers import RF_DR_LOW, Command, Register

_NO_CHIP = (0x00, 0xFF)  # STATUS if nothing drives MISO, or nothing is connected
_BAD_SPI = "check wiring and supply, or use a slower SPI clock"
_NOT_IN_OLD_CHIPS = {Register.RF_SETUP: RF_DR_LOW.mask, Register.FEATURE: 0xFF}
_OLD_CHIP = (
    'this is an nRF24L01 without "+", or a clone of it: no 250 kbit/s, no FEATURE. '
    "It works with --rate 1M --broadcast shockburst, on all nodes"
)


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
        self.command(Command.W_REGISTER | register, value)

    def write_byte(self, register: Register, value: int) -> None:
        """W_REGISTER of a register of one byte."""
        self.command(Command.W_REGISTER | register, bytes((value,)))

    def write_and_verify(self, values: Mapping[Register, bytes]) -> None:
        """Write registers and read each back; RadioError names the first that differs, and why."""
        for register, value in values.items():
            self.write(register, value)
        wrong = dict(self._differences(values))
        for register, found in wrong.items():
            written = values[register]
            raise RadioError(
                f"{register.name} was written as {written.hex()} and reads as {found.hex()}: "
                + (_OLD_CHIP if _is_old_chip(values, wrong) else _BAD_SPI)
            )

    def first_difference(self, values: Mapping[Register, bytes]) -> tuple[Register, bytes] | None:
        """The first register that does not hold its value, with the value found, or None."""
        return next(self._differences(values), None)

    def _differences(self, values: Mapping[Register, bytes]) -> Iterator[tuple[Register, bytes]]:
        for register, value in values.items():
            found = self.read(register, len(value))
            if found != value:
                yield register, found


def _is_old_chip(values: Mapping[Register, bytes], wrong: Mapping[Register, bytes]) -> bool:
    """Whether only those bits differ that a chip without "+" does not have."""
    return all(
        found[0] == values[register][0] & ~_NOT_IN_OLD_CHIPS.get(register, 0)
        for register, found in wrong.items()
    )
