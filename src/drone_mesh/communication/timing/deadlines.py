"""The current time of a component, and when each kind of work is due."""

from __future__ import annotations

import enum
import math


class Due(enum.IntEnum):
    """The kinds of work that a component schedules, in the order in which it does what is due."""

    ANSWER = 0  # the latest moment for the gateway's answer to a heartbeat
    INTRODUCE = 1  # after the antenna came back
    ROUTING = 2  # the routing technique's timer
    ASK_POSITION = 3  # in flight
    ORDER_REPLIES = 4  # a drone's outstanding replies to orders
    DATA = 5  # users' messages
    NODE_REPORT = 6  # the next report to the gateway
    OWN_ID = 7  # the end of the time in which it gives way to another radio with its id
    CHECK = 8  # the periodic check of routes and connection
    GOAL = 9  # repeats a drone's goal after take-off
    REPAIR = 10  # the repair's timer
    ORDERS = 11  # a gateway's open orders


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
