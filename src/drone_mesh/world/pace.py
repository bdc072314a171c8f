"""When the next step of the world is due: by the wall clock, and by the packets under way."""

from __future__ import annotations

import logging

CATCH_UP_S = 0.5  # a delay up to this is caught up; the rest of a longer one is lost
MEASURED_OVER_S = 10.0  # wall; a shorter time says little about a machine that is busy now and then
PATIENCE_S = 1.0  # wall; a packet on a busy machine is under way for a fraction of it
_HASTE = 0.5  # factor on the patience after each loss
_SHORTEST_S = 0.01  # wall

_log = logging.getLogger(__name__)


class Pace:
    """Keeps simulated time at a multiple of wall time. Belongs to the thread that steps."""

    def __init__(self, factor: float) -> None:
        """`factor`: simulated seconds per wall second; 0: as fast as possible."""
        self.factor = factor
        self._simulated_s = self._wall_s = 0.0
        self._started = False
        self._measured_from: tuple[float, float] | None = None  # simulated, wall

    def restart(self, factor: float) -> None:
        """Continue at this factor from now on; earlier delays are not caught up."""
        self.factor = factor
        self._started = False
        self._measured_from = None

    def achieved(self, simulated_s: float, wall_s: float) -> float | None:
        """The factor since this last returned one, or since the restart; None: not long enough."""
        if self._measured_from is None:
            self._measured_from = simulated_s, wall_s
        from_simulated_s, from_wall_s = self._measured_from
        if wall_s - from_wall_s < MEASURED_OVER_S:
            return None
        self._measured_from = simulated_s, wall_s
        return (simulated_s - from_simulated_s) / (wall_s - from_wall_s)

    def wait_s(self, simulated_s: float, wall_s: float) -> float:
        """Wall seconds until the step after `simulated_s` is due; 0: now."""
        if self.factor == 0.0:
            return 0.0
        if self._started:
            due_s = self._wall_s + (simulated_s - self._simulated_s) / self.factor
            if wall_s - due_s <= CATCH_UP_S:
                return max(0.0, due_s - wall_s)
        self._simulated_s, self._wall_s, self._started = simulated_s, wall_s, True
        return 0.0


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
