"""What a component has to do at which time."""

from __future__ import annotations

import enum
import math


class Due(enum.IntEnum):
    """The things that a component may have to do at some time."""

    CHECK = 0  # the periodic look after routes and connection
    INTRODUCE = 1  # after the antenna came back
    ASK_POSITION = 2  # in flight
    ANSWER = 3  # of the gateway, to a heartbeat: from then on it is missing
    DECIDE = 4  # a negotiation


class Deadlines:
    """One time per thing to do. Read for each packet and rarely changed, so the first is kept."""

    def __init__(self) -> None:
        self._at_s = [math.inf] * len(Due)
        self.next_s = math.inf  # the first of all

    def set(self, due: Due, at_s: float) -> None:
        """`due` is at `at_s`; infinity: it is not to be done."""
        self._at_s[due] = at_s
        self.next_s = min(self._at_s)

    def get(self, due: Due) -> float:
        """When `due` is; infinity: never."""
        return self._at_s[due]

    def clear(self) -> None:
        """Nothing is to be done."""
        self._at_s = [math.inf] * len(Due)
        self.next_s = math.inf
