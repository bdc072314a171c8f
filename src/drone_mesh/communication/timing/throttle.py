"""Throttle: counts by reason, and at most one log line per reason and period."""

from __future__ import annotations

from collections import Counter


class Throttle:
    """Decides which lines are logged. One thread at a time; the caller passes the time."""

    def __init__(self, period_s: float) -> None:
        self._period_s = period_s
        self._logged_s: dict[str, float] = {}
        self.counts: Counter[str] = Counter()

    def count(self, reason: str, now_s: float) -> bool:
        """Count `reason`; True if it is to be logged now.

        A clock that went back, as at the start of another simulation, does not silence a reason.
        """
        self.counts[reason] += 1
        logged_s = self._logged_s.get(reason)
        if logged_s is not None and 0 <= now_s - logged_s < self._period_s:
            return False
        self._logged_s[reason] = now_s
        return True
