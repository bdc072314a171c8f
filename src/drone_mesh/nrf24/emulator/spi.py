"""The SPI device in front of an emulated chip, as spidev.SpiDev shows it."""

from __future__ import annotations

from typing import Protocol, Sequence

from drone_mesh.nrf24.emulator.clock import EmulatorClock

_FASTEST_HZ = 10_000_000  # [DS 8.3.2]
_BITS_PER_NS = 8 * 1_000_000_000


class SpiTarget(Protocol):
    """The chip at the other end of the wires."""

    def chip_selected(self) -> int:
        """CSN falls; returns STATUS, the first byte sent."""

    def chip_deselected(self, mosi: bytes) -> bytes:
        """CSN rises and the command takes effect; returns the bytes after STATUS."""

    def warn(self, text: str) -> None:
        """The host violated the datasheet."""


class EmulatedSpiDev:
    """One transfer is one period of CSN low; it takes as long as its bits."""

    def __init__(self, clock: EmulatorClock, target: SpiTarget) -> None:
        self._clock = clock
        self._target = target
        self._busy = False
        self.max_speed_hz = 8_000_000
        self.mode = 0
        self.no_cs = False

    def open(self, bus: int, device: int) -> None:
        """Any bus and device select the one chip of this object."""

    def close(self) -> None:
        """Nothing to release."""

    def xfer2(self, data: Sequence[int], speed_hz: int = 0) -> list[int]:
        """Clock out `data` and return the bytes received: STATUS, then the answer."""
        clock, target = self._clock, self._target
        speed_hz = speed_hz or self.max_speed_hz
        with clock.access():
            if self._busy:
                target.warn("two SPI transfers at once")
            if speed_hz > _FASTEST_HZ or self.mode != 0:
                target.warn("SPI must be mode 0 with at most 10 MHz")
            self._busy = True
            status = target.chip_selected()
        clock.elapse(len(data) * _BITS_PER_NS // speed_hz)
        with clock.access():
            answer = target.chip_deselected(bytes(data))
            self._busy = False
        return [status, *answer]
