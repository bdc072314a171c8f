"""The CE and IRQ pins of an emulated chip."""

from __future__ import annotations

from typing import Callable

from drone_mesh.nrf24.emulator.clock import EmulatorClock


class EmulatedCe:
    """Chip enable, an output of the host. Also usable as a DigitalInOut of CircuitPython."""

    def __init__(self, clock: EmulatorClock, changed: Callable[[bool], None]) -> None:
        self._clock = clock
        self._changed = changed
        self._value = False

    @property
    def value(self) -> bool:
        """The level of the pin."""
        return self._value

    @value.setter
    def value(self, high: bool) -> None:
        with self._clock.access():
            if bool(high) != self._value:
                self._value = bool(high)
                self._changed(self._value)

    def switch_to_output(self, value: bool = False) -> None:
        """Called by CircuitPython drivers at the start."""
        self.value = value

    def close(self) -> None:
        """Does nothing; the level stays."""


class EmulatedIrq:
    """Interrupt request, an input of the host: low while an unmasked flag is set."""

    def __init__(self, clock: EmulatorClock) -> None:
        self._clock = clock
        self._signal = clock.runtime.signal()
        self.value = True  # the level of the pin
        self.fell_ns: int | None = None  # when it last went low

    def wait_low(self, timeout_s: float) -> bool:
        """Wait until the pin is low; returns False if it is still high after the time-out."""
        return self._signal.wait_for(lambda: not self.value, timeout_s)

    def set(self, high: bool) -> None:
        """Set the level, by the chip; called with access."""
        if high != self.value:
            self.value = high
            if not high:
                self.fell_ns = self._clock.now_ns
                self._signal.notify()

    def close(self) -> None:
        """Does nothing."""
