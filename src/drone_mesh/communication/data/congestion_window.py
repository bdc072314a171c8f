"""CongestionWindow: how many fragments may be under way without an acknowledgement.

Slow start and halving after a loss, as in TCP (RFC 5681), counted in fragments.
"""

from __future__ import annotations

FIRST_SIZE = 32  # our choice: less than a message of 1,024 bytes
LEAST_SIZE = 4
MOST_SIZE = 256  # our choice: six messages of 1,024 bytes


class CongestionWindow:
    """The window of one destination."""

    def __init__(self) -> None:
        self.size = float(FIRST_SIZE)
        self._slow_start = True

    def grow(self, arrived: int) -> None:
        """This many fragments have arrived."""
        self.size += arrived if self._slow_start else arrived / self.size * 4
        self.size = min(self.size, float(MOST_SIZE))

    def on_loss(self) -> None:
        """Fragments are missing."""
        self._slow_start = False
        self.size = max(float(LEAST_SIZE), self.size / 2)

    def on_silence(self) -> None:
        """There is no answer."""
        self.size, self._slow_start = float(LEAST_SIZE), True
