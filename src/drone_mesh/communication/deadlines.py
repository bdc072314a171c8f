"""What a component has to do at which time, and what time it is."""

from __future__ import annotations

import enum
import math


class Due(enum.IntEnum):
    """What a component may have to do at some time."""

    CHECK = 0  # the periodic check of routes and connection
    INTRODUCE = 1  # after the antenna came back
    ASK_POSITION = 2  # in flight
    ANSWER = 3  # the latest moment for the gateway's answer to a heartbeat
    REPAIR = 4  # what the repair waits for
    ROUTING = 5  # what the routing technique asked for
    ORDER_REPLIES = 6  # what a drone still has to say of its orders
    ORDERS = 7  # what a gateway does about orders under way
    DATA = 8  # what users' messages wait for
    NODE_REPORT = 9  # the next report to the gateway
    GOAL = 10  # a drone that took off says again where to


class Deadlines:
    """The time of the component's latest call, and one time per thing to do.

    Read for each packet and rarely changed, so the earliest of all is kept.
    """

    def __init__(self) -> None:
        self.now_s = 0.0
        self._at_s = [math.inf] * len(Due)
        self.next_s = math.inf  # the first of all

    def set(self, due: Due, at_s: float) -> None:
        """Schedule `due` at `at_s`; infinity cancels it."""
        self._at_s[due] = at_s
        self.next_s = min(self._at_s)

    def get(self, due: Due) -> float:
        """When `due` is; infinity: never."""
        return self._at_s[due]

    def clear(self) -> None:
        """Cancel everything."""
        self._at_s = [math.inf] * len(Due)
        self.next_s = math.inf
