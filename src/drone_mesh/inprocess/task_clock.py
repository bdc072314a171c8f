"""The clock of an air whose drivers block: events in seconds, and tasks that wait."""

from __future__ import annotations

import math
from typing import Any, Callable

from drone_mesh.nrf24.airtime import NS_PER_S
from drone_mesh.nrf24.emulator.cooperative_clock import CooperativeClock


class TaskClock:
    """A Clock for the network; `tasks` is the runtime of its drivers."""

    def __init__(self) -> None:
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
