"""ReplayWindow: which counter values were already used (like RFC 4303, 3.4.3, and RFC 6479)."""

from __future__ import annotations

WIDTH = 512  # packets of a busy sender that may overtake each other in its queue
LATELY_S = 10.0  # on a busy channel a packet and its copies are under way for seconds


class ReplayWindow:
    """Accepts every counter value once; values far below the highest one not at all."""

    __slots__ = ("_seen", "highest")

    def __init__(self, highest: int) -> None:
        """`highest` and all values below it count as used."""
        self.highest = highest
        self._seen = (1 << WIDTH) - 1  # bit n: highest - n was used

    def expand(self, low: int) -> int:
        """The value nearest to the highest one with these low 16 bits."""
        highest = self.highest
        return highest - _HALF + (low - highest + _HALF & _LOW)

    def use(self, value: int) -> bool:
        """Use a value whose packet is authentic. False: it was already used, or is too old."""
        ahead = value - self.highest
        if ahead > 0:
            self._seen = (self._seen << ahead | 1) & _MASK if ahead < WIDTH else 1
            self.highest = value
            return True
        bit = 1 << -ahead
        if -ahead >= WIDTH or self._seen & bit:
            return False
        self._seen |= bit
        return True


class AgedWindow(ReplayWindow):
    """A window that also tells old values from those that were new 10 to 20 s ago."""

    __slots__ = ("_before", "_mark", "turn_s")

    def __init__(self, highest: int, now_s: float) -> None:
        """What came before is unknown, so it does not count as old for that time."""
        super().__init__(highest)
        self._before = self._mark = -1
        self.turn_s = now_s + LATELY_S

    def turn(self, now_s: float) -> None:
        """To be called before a value is used when `turn_s` has come."""
        is_long_ago = now_s >= self.turn_s + LATELY_S
        self._before = self.highest if is_long_ago else self._mark
        self._mark = self.highest
        self.turn_s = now_s + LATELY_S

    def is_old(self, value: int, now_s: float) -> bool:
        """Whether higher values were used so long ago."""
        if now_s >= self.turn_s:
            self.turn(now_s)
        return value <= self._before

    def restart(self, highest: int, now_s: float) -> None:
        """`highest` and all values below it count as used, and none above it.

        Values that had not been seen before are not old: they were overtaken by what proved this.
        """
        if now_s >= self.turn_s:
            self.turn(now_s)
        self.highest, self._seen = highest, _MASK
        self._mark, self._before = min(self._mark, highest), min(self._before, highest)


_MASK = (1 << WIDTH) - 1
_LOW = 2**16 - 1
_HALF = 2**15
