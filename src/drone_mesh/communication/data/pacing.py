"""How fast an outbox sends, as in TCP: its window (RFC 5681) and its timeout (RFC 6298)."""

from __future__ import annotations

FIRST_SIZE = 32  # less than a message of 1,024 bytes
LEAST_SIZE = 4
MOST_SIZE = 256  # six messages of 1,024 bytes
FIRST_TIMEOUT_S = 1.0  # RFC 6298, 2.1
LEAST_TIMEOUT_S = 0.3  # above the half second of circulation after one doubling
MOST_TIMEOUT_S = 30.0  # three check periods; with less, POLLs alone fill a channel


class CongestionWindow:
    """How many fragments may be under way to one destination without an acknowledgement.

    Slow start and halving after a loss, counted in fragments.
    """

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
        """Shrink the window, as no answer came."""
        self.size, self._slow_start = float(LEAST_SIZE), True


class RoundTrip:
    """The timeout for one destination, estimated from its answers."""

    def __init__(self) -> None:
        self._mean_s: float | None = None
        self._deviation_s = 0.0

    @property
    def mean_s(self) -> float:
        """The mean of the answers so far; 0 without any."""
        return self._mean_s or 0.0

    def measured(self, seconds: float) -> None:
        """An answer arrived after `seconds`, to a question that was sent only once."""
        if self._mean_s is None:
            self._mean_s, self._deviation_s = seconds, seconds / 2
            return
        self._deviation_s += (abs(seconds - self._mean_s) - self._deviation_s) / 4
        self._mean_s += (seconds - self._mean_s) / 8

    def timeout_s(self, unanswered: int) -> float:
        """How long to wait for an answer, given the number of unanswered questions."""
        timeout_s = FIRST_TIMEOUT_S
        if self._mean_s is not None:
            timeout_s = max(LEAST_TIMEOUT_S, self._mean_s + 4 * self._deviation_s)
        return min(MOST_TIMEOUT_S, timeout_s * 2.0 ** min(unanswered, 8))
