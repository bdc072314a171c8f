"""Virtual clocks: they process events in order of time, as fast as possible."""

from __future__ import annotations

import math
from collections import deque
from heapq import heappop, heappush
from typing import Any, Callable, Protocol, Tuple

from drone_mesh.nrf24.registers import NS_PER_S

Event = Tuple[float, float, Callable[[Any], None], Any]
"""Time, sequence number among events of the same time, function, argument."""


def _never(_argument: Any) -> None:
    """The function of an event that never comes."""


class Clock(Protocol):
    """The time of a network, and the events planned in it."""

    @property
    def now_s(self) -> float: ...

    def call_at(self, at_s: float, function: Callable[[Any], None], argument: Any) -> None:
        """Call `function(argument)` at `at_s`, or at once if that is in the past."""

    def run_until(self, until_s: float) -> None:
        """Process all events up to and including `until_s`."""


class VirtualClock:
    """Simulated time and the events planned in it. Everything runs in the thread that runs it."""

    def __init__(self) -> None:
        self.now_s = 0.0
        # A heap. Its last event never comes, so it is never empty and need not be checked.
        self._events: list[Event] = [(math.inf, math.inf, _never, None)]
        # Events requested in order of time, like most packets; cheaper than the heap.
        self._line: deque[Event] = deque()
        self._line_ends_s = -math.inf
        self._requests = 0  # events of one time run in the order of the requests

    def call_at(self, at_s: float, function: Callable[[Any], None], argument: Any) -> None:
        """Call `function(argument)` at `at_s`, or at once if that is in the past."""
        self._requests += 1
        heappush(self._events, (at_s, self._requests, function, argument))

    def call_in_line(self, at_s: float, function: Callable[[Any], None], argument: Any) -> None:
        """Like `call_at`, but cheaper if calls request ascending times."""
        if at_s < self._line_ends_s:
            self.call_at(at_s, function, argument)
            return
        self._line_ends_s = at_s
        self._requests += 1
        self._line.append((at_s, self._requests, function, argument))

    def next_event_s(self) -> float:
        """The time of the next event; infinity if none is planned."""
        at_s = self._events[0][0]
        return min(at_s, self._line[0][0]) if self._line else at_s

    def run_until(self, until_s: float) -> None:
        """Process all events up to and including `until_s`."""
        events, line = self._events, self._line
        pop, pop_line = heappop, line.popleft
        while True:
            if line and line[0] < events[0]:
                at_s, _order, function, argument = line[0]
                if at_s > until_s:
                    break
                pop_line()
            else:
                at_s, _order, function, argument = events[0]
                if at_s > until_s or function is _never:
                    break
                pop(events)
            if at_s > self.now_s:
                self.now_s = at_s
            function(argument)
        self.now_s = max(self.now_s, until_s)


class TaskClock:
    """The clock of an air whose drivers block: `tasks` is their runtime, in which they wait."""

    def __init__(self) -> None:
        from drone_mesh.nrf24.emulator.cooperative_clock import CooperativeClock  # needs greenlet

        self.tasks = CooperativeClock()

    @property
    def now_s(self) -> float:
        return self.tasks.now_s()

    def call_at(self, at_s: float, function: Callable[[Any], None], argument: Any) -> None:
        """Call `function(argument)` at `at_s`, or at once if that is past; it must not wait."""
        at_ns = max(math.ceil(at_s * NS_PER_S), self.tasks.now_ns)
        if at_ns / NS_PER_S < at_s:  # the product was rounded down: the time would not have come
            at_ns += 1
        self.tasks.call_at(at_ns, function, argument)

    def run_until(self, until_s: float) -> None:
        """Process all events up to and including `until_s`."""
        self.tasks.sleep(max(0.0, until_s - self.now_s))
