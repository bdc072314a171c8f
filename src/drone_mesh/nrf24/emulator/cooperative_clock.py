"""A clock that jumps from event to event, with cooperative tasks: same seed, same result.

Drivers block, so each of them needs its own stack. The stacks are greenlets: one runs at a time,
and a switch takes less than a microsecond, while a switch between threads takes twenty. A task that
sleeps or waits processes the events that are due before its own time. When one of them wakes
another task, it switches to that one. So all state of the air and of the clock belongs to the task
that has the turn, the order of events never depends on the machine's scheduler, and a minute of a
quiet mesh takes milliseconds.

`start` creates tasks; the code that created the clock has the first turn. Everything runs in the
thread that created the clock.
"""

from __future__ import annotations

import contextlib
import heapq
import logging
import math
from typing import Any, Callable, ContextManager

import greenlet

from drone_mesh.channel.runtime import Runtime, Signal, Task
from drone_mesh.nrf24.emulator.clock import EmulatorClock
from drone_mesh.nrf24.registers import NS_PER_S

__all__ = ["CooperativeClock"]  # for users; see docs/architecture.md

logger = logging.getLogger(__name__)


def _nanoseconds(duration_s: float) -> int:
    """At least one if the duration is positive, otherwise a loop that waits would never end."""
    return max(round(duration_s * NS_PER_S), 1 if duration_s > 0 else 0)


class _Turn:
    """One task's place in the order of turns."""

    __slots__ = ("parked", "stack")

    def __init__(self, stack: greenlet.greenlet) -> None:
        self.stack = stack
        self.parked = 0  # number of waits, to recognise wake-ups for earlier ones


class _VirtualTask:
    def __init__(self, clock: CooperativeClock, run: Callable[[], None], name: str) -> None:
        self.turn = _Turn(greenlet.greenlet(self._live, clock.first_stack))
        self.name = name
        self.done = False
        self.failure: BaseException | None = None
        self._clock = clock
        self._run = run
        self.ended = clock.signal()
        # The depth of a stack counts from where it is first entered. So enter it here, where the
        # depth is low: entered when their turns come, the depths of all tasks would add up.
        self.turn.stack.switch(greenlet.getcurrent())

    def join(self) -> None:
        """Wait until it has ended; raises an exception that ended it."""
        self.ended.wait_for(lambda: self.done, math.inf)
        if self.failure is not None:
            raise RuntimeError(f"{self.name} failed") from self.failure

    def _live(self, starter: greenlet.greenlet) -> None:
        starter.switch()
        try:
            self._run()
        except greenlet.GreenletExit:  # the clock is gone, and the task with it
            return
        except BaseException as failure:
            logger.exception("%s failed", self.name)
            self.failure = failure
        self.done = True
        self.ended.notify()
        self.turn.stack.parent = self._clock.next_turn().stack  # continues when this returns


class CooperativeClock(Runtime, EmulatorClock):
    """Both the clock of the air and the runtime of its drivers."""

    def __init__(self) -> None:
        self.now_ns = 0
        self._events: list[tuple[int, int, Callable[..., None] | None, tuple[Any, ...]]] = []
        self._count = 0
        self.first_stack = greenlet.getcurrent()  # of the code that created the clock
        self._first = self._running = _Turn(self.first_stack)
        self._stuck = False
        self._no_lock = contextlib.nullcontext()

    @property
    def runtime(self) -> Runtime:
        return self

    def now_s(self) -> float:
        return self.now_ns / NS_PER_S

    def call_at(self, time_ns: int, event: Callable[..., None], *arguments: object) -> None:
        self._count += 1
        heapq.heappush(self._events, (time_ns, self._count, event, arguments))

    def access(self) -> ContextManager[object]:
        return self._no_lock

    def sleep(self, duration_s: float) -> None:
        self.elapse(_nanoseconds(duration_s))

    def elapse(self, duration_ns: int) -> None:
        until_ns = self.now_ns + duration_ns
        if not self._events or self._events[0][0] > until_ns:
            self.now_ns = until_ns
            return
        self._running.parked += 1
        self._wake_at(until_ns, self._running)
        self._wait_for_turn(self._running)

    def signal(self) -> Signal:
        return _VirtualSignal(self)

    def lock(self) -> ContextManager[object]:
        return _VirtualLock(self)

    def start(self, run: Callable[[], None], name: str) -> Task:
        task = _VirtualTask(self, run, name)
        self._wake_at(self.now_ns, task.turn)
        return task

    def wait(self, waiting: list[tuple[_Turn, int]], until_ns: float) -> None:
        """Add the running task to the list, and wait to be woken or until that time."""
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
        """Wake all tasks on the list; they run at this same time, when the caller itself waits."""
        for turn, parked in waiting:
            if turn.parked == parked:
                self._wake_at(self.now_ns, turn)
        waiting.clear()

    def _wake_at(self, time_ns: int, turn: _Turn) -> None:
        self._count += 1
        heapq.heappush(self._events, (time_ns, self._count, None, (turn, turn.parked)))

    def _wait_for_turn(self, turn: _Turn) -> None:
        following = self.next_turn()
        if following is not turn:
            following.stack.switch()
        if self._stuck:
            raise RuntimeError("every task on the virtual clock waits for ever")
        turn.parked += 1  # other queued wake-ups belong to the wait that ends here

    def next_turn(self) -> _Turn:
        """Process events until one wakes a task, which then has the turn."""
        events = self._events
        while events:
            self.now_ns, _, event, arguments = heapq.heappop(events)
            if event is not None:
                event(*arguments)
                continue
            turn: _Turn = arguments[0]
            if turn.parked == arguments[1]:
                self._running = turn
                return turn
        self._stuck = True  # raised in the code that created the clock; the tasks never continue
        self._running = self._first
        return self._first


class _VirtualSignal(Signal):
    def __init__(self, clock: CooperativeClock) -> None:
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
    """Goes to the waiting tasks in order of arrival, so that none starves."""

    def __init__(self, clock: CooperativeClock) -> None:
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
