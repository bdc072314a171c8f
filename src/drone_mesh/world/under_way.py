"""UnderWay: packets that were handed over, and that no node has worked off yet."""

from __future__ import annotations

import logging

PATIENCE_S = 1.0  # our choice, wall; a packet on a busy machine is under way for a fraction of it
_HASTE = 0.5  # our choice: how much less patience there is after each loss
_SHORTEST_S = 0.01  # wall

_log = logging.getLogger(__name__)


class UnderWay:
    """Tells packets that will still arrive from those that never will.

    A packet gets lost when its receiver ends while it is under way, or when a simulator accepts
    packets that it does not deliver. Then the number of packets under way does not return to what
    it was; if it does not change for a while either, it is the number to be expected from now on.
    The wait is shorter from one loss to the next, and as long as at first after none was lost.

    Belongs to the thread that steps the world.
    """

    def __init__(self) -> None:
        self._lost = 0
        self._count = 0
        self._since_s = 0.0  # wall; since when the count is the same, and the nodes do nothing
        self._patience_s = PATIENCE_S

    def is_none(self, count: int, idle: bool, wall_s: float) -> bool:
        """Whether nothing is under way, if `count` packets are not worked off at `wall_s`.

        `idle`: the nodes have nothing to do but to wait for packets. The count may be too low for
        a moment, as a process reports a packet that it received before another reports that it
        sent it.
        """
        if count != self._count or not idle:
            self._count, self._since_s = count, wall_s
            if count == self._lost:
                self._patience_s = PATIENCE_S
        elif count != self._lost and wall_s - self._since_s > self._patience_s:
            _log.debug("%d packets were handed over and are lost", count - self._lost)
            self._lost = count
            self._patience_s = max(_SHORTEST_S, self._patience_s * _HASTE)
        return count == self._lost
