"""ReplayWindow: which counter values were already used (like RFC 4303, 3.4.3, and RFC 6479)."""

from __future__ import annotations

WIDTH = 512  # our choice: packets of a busy sender that may overtake each other in its queue


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


_MASK = (1 << WIDTH) - 1
_LOW = 2**16 - 1
_HALF = 2**15
