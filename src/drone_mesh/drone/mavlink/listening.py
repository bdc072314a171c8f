"""ListeningClock: time during which a program really listened to its autopilot.

A busy machine may give a program no time for seconds. That is not the autopilot's silence: what was
said meanwhile waits in the line, or nobody said anything because the whole machine stood still.
"""

from __future__ import annotations

LONGEST_STEP_S = 0.2  # our choice: four ticks of the engine; what is longer was not listening
ASLEEP_S = 1.0  # our choice: after so long the pilot may have chosen another mode unseen


class ListeningClock:
    """Runs with the machine's clock, except over gaps of the caller's, which count as one step."""

    def __init__(self, machine_s: float) -> None:
        """It begins with the machine's time."""
        self.now_s = machine_s
        self.slept_s = 0.0  # the latest step, if it was as long as ASLEEP_S; otherwise 0
        self._machine_s = machine_s

    def step(self, machine_s: float) -> None:
        """The caller has just read the line."""
        passed_s = max(0.0, machine_s - self._machine_s)
        self._machine_s = machine_s
        self.now_s += min(passed_s, LONGEST_STEP_S)
        self.slept_s = passed_s if passed_s >= ASLEEP_S else 0.0
