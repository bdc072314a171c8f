"""RoundTrip: how long to wait for an acknowledgement (RFC 6298)."""

from __future__ import annotations

FIRST_TIMEOUT_S = 1.0  # RFC 6298, 2.1
LEAST_TIMEOUT_S = 0.3  # our choice: above the half second of circulation after one doubling
MOST_TIMEOUT_S = 30.0  # our choice: three check periods; with less, POLLs alone fill a channel


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
