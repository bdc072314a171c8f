"""The two clocks an emulated air can live by: virtual time and the time of the wall.

Events of the air (a frame ends, a chip has settled) happen at exact integer nanoseconds in both.
Under the virtual clock nothing takes time except what says so: an SPI transfer, a sleep, a wait.
"""

from __future__ import annotations

import abc
from typing import Callable, ContextManager

from drone_mesh.nrf24.runtime import Runtime, Signal


class EmulatorClock(abc.ABC):
    """Time of one air, its queue of events, and the right to touch its chips."""

    @property
    @abc.abstractmethod
    def now_ns(self) -> int:
        """Time of the air. Within an event: the time for which the event was meant."""

    @property
    @abc.abstractmethod
    def runtime(self) -> Runtime:
        """What drivers on this air take time and threads from."""

    @abc.abstractmethod
    def call_at(self, time_ns: int, event: Callable[..., None], *arguments: object) -> None:
        """Have `event` called at that time. Events of one time run in the order of the calls."""

    @abc.abstractmethod
    def access(self) -> ContextManager[object]:
        """Held while something from outside touches a chip: nothing else happens meanwhile."""

    @abc.abstractmethod
    def elapse(self, duration_ns: int) -> None:
        """An SPI transfer takes that long. Called without access."""

    @abc.abstractmethod
    def signal(self) -> Signal:
        """A new signal for waiters on this clock."""
