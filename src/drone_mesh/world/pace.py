"""Pace: when the next step of the world is due on the wall clock."""

from __future__ import annotations

CATCH_UP_S = 0.5  # a delay up to this is caught up; the rest of a longer one is lost
MEASURED_OVER_S = 10.0  # wall; a shorter time says little about a machine that is busy now and then


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
