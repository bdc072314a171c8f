"""UnderWay: packets that were handed over and that no node has processed yet."""

from __future__ import annotations

import logging

PATIENCE_S = 1.0  # wall; a packet on a busy machine is under way for a fraction of it
_HASTE = 0.5  # factor on the patience after each loss
_SHORTEST_S = 0.01  # wall

_log = logging.getLogger(__name__)


class UnderWay:
    """Distinguishes packets that will still arrive from lost ones.

    A packet is lost when its receiver ends before it arrives, or when a simulator accepts packets
    that it does not deliver. The number of packets under way then never returns to its old value;
    once it has been constant for a while, it becomes the expected number. This wait gets shorter
    with each loss in a row, and is reset when nothing was lost.

    Belongs to the thread that steps the world.
    """

    def __init__(self) -> None:
        self._lost = 0
        self._count = 0
        self._since_s = 0.0  # wall; since when the count is constant and the nodes are idle
        self._patience_s = PATIENCE_S

    def is_none(self, count: int, idle: bool, wall_s: float) -> bool:
        """Whether nothing is under way, given `count` unprocessed packets at `wall_s`.

        `idle`: the nodes only wait for packets. The count may briefly be too low, because the
        receiving process may report a packet before the sending one does.
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
