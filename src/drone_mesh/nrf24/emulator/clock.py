"""The two clocks of an emulated air: virtual time and wall time.

Events of the air (a frame ends, a chip has settled) happen at exact integer nanoseconds in both.
Under the virtual clock only SPI transfers, sleeps and waits take time.
"""

from __future__ import annotations

import abc
from typing import Callable, ContextManager

from drone_mesh.channel.runtime import Runtime


class EmulatorClock(abc.ABC):
    """The time of one air, its event queue, and the exclusive access to its chips."""

    now_ns: int
    """Time of the air. Within an event: the time for which the event was scheduled."""

    @property
    @abc.abstractmethod
    def runtime(self) -> Runtime:
        """The time, signals and threads of whoever waits for a chip on this air."""

    @abc.abstractmethod
    def call_at(self, time_ns: int, event: Callable[..., None], *arguments: object) -> None:
        """Call `event` at that time. Events of the same time run in the order of these calls."""

    @abc.abstractmethod
    def access(self) -> ContextManager[object]:
        """Held while code outside the air accesses a chip; no event runs meanwhile."""

    @abc.abstractmethod
    def elapse(self, duration_ns: int) -> None:
        """An SPI transfer takes this long. Called without access."""
