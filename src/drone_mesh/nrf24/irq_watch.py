"""Decides whether the IRQ pin works, or the chip must be polled."""

from __future__ import annotations

_PATIENCE = 3  # contradictions; a single one may be a race


class IrqWatch:
    """Compares the pin with the state of the chip. For the receiving thread."""

    def __init__(self) -> None:
        self.trusted = True
        self._said: bool | None = None  # whether the pin was low; None: not read
        self._contradictions = 0

    def woken(self, low: bool) -> None:
        """The wait for the pin is over."""
        self._said = low

    def polled(self, found: bool, low_for_nothing: bool) -> bool:
        """The chip was read after the wait; returns whether the pin is now considered broken.

        `found`: there were payloads, so the pin should have been low. `low_for_nothing`: all flags
        are clear, but the pin is low.
        """
        said, self._said = self._said, None
        if low_for_nothing or (found and said is False):
            self._contradictions += 1
        elif found and said:
            self._contradictions = 0
        if self._contradictions < _PATIENCE or not self.trusted:
            return False
        self.trusted = False
        return True
