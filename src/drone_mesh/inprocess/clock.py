"""A virtual clock: events in the order of their time, as fast as they can be worked off."""

from __future__ import annotations

import heapq
import itertools
import math
from typing import Any, Callable


class VirtualClock:
    """Simulated time and what is to happen in it. Everything runs in the thread that runs it."""

    def __init__(self) -> None:
        self.now_s = 0.0
        self._events: list[tuple[float, int, Callable[[Any], None], Any]] = []
        self._order = itertools.count()  # events of one moment happen in the order of their asking

    def call_at(self, at_s: float, function: Callable[[Any], None], argument: Any) -> None:
        """Call `function(argument)` at `at_s`, or at once if that is past."""
        heapq.heappush(self._events, (at_s, next(self._order), function, argument))

    def next_event_s(self) -> float:
        """When something happens next; infinity when nothing is planned."""
        return self._events[0][0] if self._events else math.inf

    def run_until(self, until_s: float) -> None:
        """Let everything happen up to and including `until_s`."""
        events = self._events
        pop = heapq.heappop
        while events and events[0][0] <= until_s:
            at_s, _order, function, argument = pop(events)
            if at_s > self.now_s:
                self.now_s = at_s
            function(argument)
        self.now_s = max(self.now_s, until_s)
