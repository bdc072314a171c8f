"""A clock that jumps from event to event, with threads that take turns: same seed, same result.

Drivers block, so each of them needs a thread. But only one thread at a time runs: whoever sleeps
or waits works off the events that come before its own time is up, and when one of them is the
waking of another thread, it hands over to that one. So all state of the air and of the clock
belongs to the thread that has the turn, the order of things never depends on the scheduler of the
machine, and a minute of a quiet mesh takes milliseconds.

Threads are started with `start`; the one that made the clock has the first turn.
"""

from __future__ import annotations

import contextlib
import heapq
import logging
import math
import threading
from typing import Any, Callable, ContextManager

from drone_mesh.nrf24.airtime import NS_PER_S
from drone_mesh.nrf24.emulator.clock import EmulatorClock, Signal
from drone_mesh.nrf24.runtime import Runtime, Task

logger = logging.getLogger(__name__)


def _nanoseconds(duration_s: float) -> int:
    """At least one if there is anything to wait for, or a loop that waits would not end."""
    return max(round(duration_s * NS_PER_S), 1 if duration_s > 0 else 0)


class _Turn:
    """One thread's place in the order of turns."""

    __slots__ = ("baton", "parked")

    def __init__(self) -> None:
        self.baton = threading.Lock()
        self.baton.acquire()
        self.parked = 0  # counts the waits, so that a wake-up for an earlier one is recognised


class _VirtualTask(Task):
    def __init__(self, clock: VirtualClock, name: str) -> None:
        self.turn = _Turn()
        self.name = name
        self.done = False
        self.failure: BaseException | None = None
        self._clock = clock
        self.ended = clock.signal()

    def join(self) -> None:
        """Wait until it has ended; what it raised is raised here."""
        self.ended.wait_for(lambda: self.done, math.inf)
        if self.failure is not None:
            raise RuntimeError(f"{self.name} failed") from self.failure


class VirtualClock(Runtime, EmulatorClock):
    """Both the clock of the air and the runtime of the drivers on it."""

    def __init__(self) -> None:
        self._now_ns = 0
        self._events: list[tuple[int, int, Callable[..., None] | None, tuple[Any, ...]]] = []
        self._count = 0
        self._first = self._running = _Turn()
        self._stuck = False
        self._no_lock = contextlib.nullcontext()

    @property
    def now_ns(self) -> int:
        return self._now_ns

    @property
    def runtime(self) -> Runtime:
        return self

    def now_s(self) -> float:
        return self._now_ns / NS_PER_S

    def call_at(self, time_ns: int, event: Callable[..., None], *arguments: object) -> None:
        self._count += 1
        heapq.heappush(self._events, (time_ns, self._count, event, arguments))

    def access(self) -> ContextManager[object]:
        return self._no_lock

    def sleep(self, duration_s: float) -> None:
        self.elapse(_nanoseconds(duration_s))

    def elapse(self, duration_ns: int) -> None:
        until_ns = self._now_ns + duration_ns
        if not self._events or self._events[0][0] > until_ns:
            self._now_ns = until_ns
            return
        self._running.parked += 1
        self._wake_at(until_ns, self._running)
        self._wait_for_turn(self._running)

    def signal(self) -> Signal:
        return _VirtualSignal(self)

    def lock(self) -> ContextManager[object]:
        return _VirtualLock(self)

    def start(self, run: Callable[[], None], name: str) -> Task:
        task = _VirtualTask(self, name)

        def live() -> None:
            task.turn.baton.acquire()
            try:
                run()
            except BaseException as failure:
                logger.exception("%s failed", name)
                task.failure = failure
            task.done = True
            task.ended.notify()
            self._next_turn(None)

        self._wake_at(self._now_ns, task.turn)
        threading.Thread(target=live, name=name, daemon=True).start()
        return task

    def wait(self, waiting: list[tuple[_Turn, int]], until_ns: float) -> None:
        """Put the running thread on the list, and wait to be woken or until that time."""
        turn = self._running
        turn.parked += 1
        entry = (turn, turn.parked)
        waiting.append(entry)
        if until_ns != math.inf:
            self._wake_at(int(until_ns), turn)
        self._wait_for_turn(turn)
        if entry in waiting:  # the time was over
            waiting.remove(entry)

    def wake(self, waiting: list[tuple[_Turn, int]]) -> None:
        """Let all on the list go on: at this same time, when the caller waits himself."""
        for turn, parked in waiting:
            if turn.parked == parked:
                self._wake_at(self._now_ns, turn)
        waiting.clear()

    def _wake_at(self, time_ns: int, turn: _Turn) -> None:
        self._count += 1
        heapq.heappush(self._events, (time_ns, self._count, None, (turn, turn.parked)))

    def _wait_for_turn(self, turn: _Turn) -> None:
        if not self._next_turn(turn):
            turn.baton.acquire()
            if self._stuck:
                raise RuntimeError("every thread on the virtual clock waits for ever")
        turn.parked += 1  # any other wake-up that is still queued is for the wait that ends here

    def _next_turn(self, mine: _Turn | None) -> bool:
        """Work off events until some thread is to go on; True if that is `mine`."""
        events = self._events
        while events:
            self._now_ns, _, event, arguments = heapq.heappop(events)
            if event is not None:
                event(*arguments)
                continue
            turn, parked = arguments
            if turn.parked != parked:
                continue
            self._running = turn
            if turn is mine:
                return True
            turn.baton.release()
            return False
        self._stuck = True  # told to the thread that made the clock; the others never go on
        self._first.baton.release()
        return False


class _VirtualSignal(Signal):
    def __init__(self, clock: VirtualClock) -> None:
        self._clock = clock
        self._waiting: list[tuple[_Turn, int]] = []

    def wait_for(self, condition: Callable[[], bool], timeout_s: float) -> bool:
        clock = self._clock
        until_ns = math.inf
        if timeout_s != math.inf:
            until_ns = clock.now_ns + _nanoseconds(timeout_s)
        while not condition():
            if clock.now_ns >= until_ns:
                return False
            clock.wait(self._waiting, until_ns)
        return True

    def notify(self) -> None:
        if self._waiting:
            self._clock.wake(self._waiting)


class _VirtualLock(ContextManager[object]):
    """Goes to those who wait in the order in which they came: nobody starves."""

    def __init__(self, clock: VirtualClock) -> None:
        self._clock = clock
        self._held = False
        self._queue: list[list[tuple[_Turn, int]]] = []

    def __enter__(self) -> object:
        if self._held:
            waiting: list[tuple[_Turn, int]] = []
            self._queue.append(waiting)
            self._clock.wait(waiting, math.inf)
        self._held = True
        return self

    def __exit__(self, *_exc: object) -> None:
        if self._queue:
            self._clock.wake(self._queue.pop(0))  # stays held: it is handed over
        else:
            self._held = False
