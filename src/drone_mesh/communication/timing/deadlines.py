"""The current time of a component, and when each kind of work is due."""

from __future__ import annotations

import enum
import math


class Due(enum.IntEnum):
    """The kinds of work that a component schedules."""

    CHECK = 0  # the periodic check of routes and connection
    INTRODUCE = 1  # after the antenna came back
    ASK_POSITION = 2  # in flight
    ANSWER = 3  # the latest moment for the gateway's answer to a heartbeat
    REPAIR = 4  # the repair's timer
    ROUTING = 5  # the routing technique's timer
    ORDER_REPLIES = 6  # a drone's outstanding replies to orders
    ORDERS = 7  # a gateway's open orders
    DATA = 8  # users' messages
    NODE_REPORT = 9  # the next report to the gateway
    GOAL = 10  # repeats a drone's goal after take-off
    OWN_ID = 11  # the end of the time in which it gives way to another radio with its id


class Deadlines:
    """The time of the component's latest call, and one deadline per kind of work.

    Read for each packet and rarely changed, so the earliest deadline is cached.
    """

    def __init__(self) -> None:
        self.now_s = 0.0
        self.at_s = [math.inf] * len(Due)  # by Due; changes only here
        self.next_s = math.inf  # the earliest of all

    def set(self, due: Due, at_s: float) -> None:
        """Schedule `due` at `at_s`; infinity cancels it."""
        before_s = self.at_s[due]
        self.at_s[due] = at_s
        if at_s <= self.next_s:
            self.next_s = at_s
        elif before_s <= self.next_s:
            self.next_s = min(self.at_s)

    def get(self, due: Due) -> float:
        """When `due` is; infinity: never."""
        return self.at_s[due]

    def clear(self) -> None:
        """Cancel everything."""
        self.at_s[:] = [math.inf] * len(Due)
        self.next_s = math.inf
