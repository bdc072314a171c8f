"""The clock of an emulated air: its interface, and the clock of an air in real time.

Events of the air (a frame ends, a chip has settled) happen at exact integer nanoseconds.
`cooperative_clock` is the clock in virtual time, under which only SPI transfers, sleeps and waits
take time.
"""

from __future__ import annotations

import abc
import contextlib
import heapq
import logging
import threading
import time
from typing import Any, Callable, ContextManager, Iterator

from drone_mesh.channel.runtime import Runtime, SystemRuntime
from drone_mesh.nrf24.registers import NS_PER_S

logger = logging.getLogger(__name__)


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


class WallClock(EmulatorClock):
    """The clock of an air in real time. Starts its thread at once; `close` ends it.

    One thread processes events at their time. Every access to a chip first processes overdue
    events, so a chip never answers from the past. Events carry the time for which they were
    scheduled, so chips acknowledge and retransmit on time, however late the machine is.

    The lock guards the air, its chips and the queue; every access and every event holds it.
    """

    def __init__(self) -> None:
        self._start_ns = time.monotonic_ns()
        self.now_ns = 0
        self._events: list[tuple[int, int, Callable[..., None], tuple[Any, ...]]] = []
        self._count = 0
        self._lock = threading.RLock()
        self._earlier = threading.Condition(self._lock)
        self._closed = False
        self._runtime = SystemRuntime()
        self._thread = threading.Thread(target=self._run, name="emulated air", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """End the thread; queued events never happen."""
        with self._lock:
            self._closed = True
            self._earlier.notify()
        self._thread.join()

    @property
    def runtime(self) -> Runtime:
        return self._runtime

    def call_at(self, time_ns: int, event: Callable[..., None], *arguments: object) -> None:
        with self._lock:
            self._count += 1
            heapq.heappush(self._events, (time_ns, self._count, event, arguments))
            if self._events[0][1] == self._count:
                self._earlier.notify()

    @contextlib.contextmanager
    def access(self) -> Iterator[None]:
        with self._lock:
            self._catch_up()
            yield

    def elapse(self, duration_ns: int) -> None:
        """Does nothing: the host is slower than SPI anyway."""

    def _catch_up(self) -> None:
        while True:
            wall_ns = time.monotonic_ns() - self._start_ns
            if not self._events or self._events[0][0] > wall_ns:
                self.now_ns = max(self.now_ns, wall_ns)
                return
            time_ns, _, event, arguments = heapq.heappop(self._events)
            self.now_ns = max(self.now_ns, time_ns)
            try:
                event(*arguments)
            except Exception:
                logger.exception("an event of the emulated air failed; the emulation continues")

    def _run(self) -> None:
        with self._lock:
            while not self._closed:
                self._catch_up()
                if self._events:
                    due_ns = self._events[0][0] - (time.monotonic_ns() - self._start_ns)
                    self._earlier.wait(max(due_ns, 0) / NS_PER_S)
                else:
                    self._earlier.wait()
