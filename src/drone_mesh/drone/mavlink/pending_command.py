"""PendingCommand: one command to an autopilot, from its first try to its effect or its refusal."""

from __future__ import annotations

import math
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

PERIOD_S = 1.0  # our choice: an autopilot acknowledges within tens of milliseconds
REFUSED_AFTER_S = 1.5  # our choice: the words, or the effect of a try before, may come later
MOST_WORDS = 50  # of a STATUSTEXT

TAKEN = (mavlink.MAV_RESULT_ACCEPTED, mavlink.MAV_RESULT_IN_PROGRESS)
LATER = mavlink.MAV_RESULT_TEMPORARILY_REJECTED


class PendingCommand:
    """What was sent and what came back; the caller sends, and sees the effect."""

    def __init__(
        self,
        number: int,
        parameters: tuple[float, ...],
        now_s: float,
        within_s: float,
        once: bool,
    ) -> None:
        """MAV_CMD `number`. `within_s`: the time for its effect; `once`: see `is_due`."""
        self.number = number
        self.parameters = parameters
        self.tries = 0
        self.words = ""  # the autopilot's own
        self._until_s = now_s + within_s
        self._within_s = within_s
        self._once = once
        self._sent_s = -math.inf
        self._result: int | None = None  # of the latest acknowledgement
        self._refused_s = math.inf

    def is_due(self, now_s: float) -> bool:
        """Whether to send it now: at first, while no answer comes, and when it was put off.

        With `once` silence is no reason: the autopilot may have carried it out.
        """
        if now_s < self._sent_s + PERIOD_S or self.tries and now_s >= self._until_s:
            return False
        if self._result is None:
            return self.tries == 0 or not self._once
        return bool(self._result == LATER)

    def sent_at(self, now_s: float) -> None:
        """It is being sent."""
        self.tries += 1
        self._sent_s = now_s

    def acknowledged(self, result: int, now_s: float) -> None:
        """COMMAND_ACK with this MAV_RESULT."""
        if self._result in TAKEN:
            return  # a repetition may be refused because the first try is being carried out
        self._result = result
        if result not in TAKEN and result != LATER and self._refused_s == math.inf:
            self._refused_s = now_s + REFUSED_AFTER_S

    def refusal(self, now_s: float) -> str:
        """Why it is not carried out, if its time is over or it was refused; otherwise empty."""
        if now_s < min(self._until_s, self._refused_s):
            return ""
        if self.words:
            return self.words[:MOST_WORDS]
        if self._result is None:
            return f"the autopilot did not answer within {self._within_s:g} s"
        if self._result in TAKEN:
            return f"the autopilot accepted it, nothing happened for {self._within_s:g} s"
        return f"the autopilot refused: {result_name(self._result)}"


def result_name(result: int) -> str:
    """The name of a MAV_RESULT."""
    entry: Any = mavlink.enums["MAV_RESULT"].get(result)
    return str(entry.name)[len("MAV_RESULT_") :].lower() if entry else f"result {result}"
