"""MeshExecutor: one thread that drives all mesh components of a process.

The core has no threads (docs/protocol.md, "Driven from outside"). Packets, orders and time meet
here: work from other threads waits in one first-in-first-out queue, timers wait in a heap of
deadlines, and one worker runs whatever has waited longest. Requests from outside simulated
time, such as orders of users, wait until nothing else does.
"""

from __future__ import annotations

import heapq
import itertools
import logging
import math
import queue
import threading
from collections import Counter, deque
from typing import Callable, Protocol

FAILURE_PERIOD_S = 30.0  # one traceback per kind of failure in this time
RETRY_AFTER_S = 1.0  # pause before failed work that is still due runs again
MOST_WAITING = 1000  # packets for one node; four from each other node
REQUESTS_PER_STEP = 4  # of simulated time, which goes on while further ones wait
REQUEST_PAUSE_S = 0.05  # wall; then as many again, if simulated time stands still
_WAKE = None  # in the queue: no function, only check the deadlines again

_log = logging.getLogger(__name__)

Work = Callable[[float], None]
"""A function of the time at which it runs."""

Submit = Callable[[Work], None]
"""Runs a function on the thread that owns a node. Any thread may call it."""


class PacketInbox:
    """Packets that wait for one node. When too many do, new ones are dropped, as on the air.

    Any thread may call `put`; the function runs where `submit` runs it.
    """

    def __init__(self, submit: Submit, most: int = MOST_WAITING) -> None:
        self._submit = submit
        self._free = threading.BoundedSemaphore(most)
        self._counting = threading.Lock()
        self.dropped = 0

    def put(self, function: Work) -> bool:
        """Queue `function(now_s)`. False: too many wait, and it is dropped."""
        if not self._free.acquire(blocking=False):
            with self._counting:
                self.dropped += 1
            return False

        def run(now_s: float) -> None:
            self._free.release()
            function(now_s)

        self._submit(run)
        return True


class Driven(Protocol):
    """A mesh component, as the executor drives it."""

    @property
    def next_tick_s(self) -> float:
        """When `tick` must be called next; math.inf: never. May change with every call."""

    def tick(self, now_s: float) -> None:
        """Do what is due."""


class _Periodic:
    """Calls a function once per period, until it is cancelled."""

    def __init__(self, period_s: float, function: Work, first_s: float) -> None:
        self._period_s = period_s
        self._function = function
        self.next_tick_s = first_s

    def tick(self, now_s: float) -> None:
        """Call it, if it is due; skip periods that have already passed."""
        if now_s >= self.next_tick_s:
            passed = (now_s - self.next_tick_s) // self._period_s
            self.next_tick_s += self._period_s * (passed + 1.0)
            self._function(now_s)

    def cancel(self) -> None:
        self.next_tick_s = math.inf


class ExecutorSlot:
    """One component's place in an executor; the antenna uses `submit` before the component exists.

    Any thread may call `submit`, `request` and `call_every`; the rest is for the executor's worker.
    """

    def __init__(self, executor: MeshExecutor) -> None:
        self._executor = executor
        self._driven: Driven | None = None
        self.scheduled_s = math.inf

    def submit(self, function: Work) -> None:
        """Run `function(now_s)` on the worker's thread, after all earlier submissions."""
        self._executor.submit(function, self)

    def request(self, function: Work) -> None:
        """Like MeshExecutor.request, for this slot."""
        self._executor.request(function, self)

    def drive(self, driven: Driven) -> None:
        """Drive this component from now on. Only on the worker's thread."""
        self._driven = driven

    def call_every(self, period_s: float, function: Work) -> Callable[[], None]:
        """Have the executor call `function` once per period; returns a function that stops it."""
        return self._executor.call_every(period_s, function)

    @property
    def next_tick_s(self) -> float:
        return math.inf if self._driven is None else self._driven.next_tick_s

    def tick(self, now_s: float) -> None:
        if self._driven is not None:
            self._driven.tick(now_s)


class MeshExecutor:
    """Owns components and calls into them from one thread.

    Any thread may use `submit`, `request`, `call_every`, `time_advanced`, `lag_s`, `start` and
    `stop`. An exception from one component is logged and counted, and does not affect the others.
    """

    def __init__(
        self, clock: Callable[[], float], clock_notifies: bool, name: str = "mesh"
    ) -> None:
        """`clock` gives the time in seconds.

        `clock_notifies`: the code that advances the clock calls `time_advanced` (simulated time).
        Otherwise the clock runs by itself, at one second per second.
        """
        self._clock = clock
        self._clock_notifies = clock_notifies
        self._queue: queue.SimpleQueue[tuple[float, Work, ExecutorSlot | None] | None] = (
            queue.SimpleQueue()
        )
        self._requests: deque[tuple[Work, ExecutorSlot | None]] = deque()
        self._thread = threading.Thread(target=self._work, name=name, daemon=True)
        self._stopping = False
        self._on_idle: Callable[[], None] = lambda: None
        self.idle = False  # whether the worker, which writes it, waits for work
        # Written by the worker, read by others; single floats need no lock.
        self._working_since_s = math.inf  # when the current work was due
        self._next_due_s = math.inf
        self._worst_lag_s = 0.0
        # Only for the worker.
        self._deadlines: list[tuple[float, int, ExecutorSlot]] = []
        self._order = itertools.count()
        self._served_s, self._served = -math.inf, 0  # requests, and at which time of the clock
        self._logged_s: dict[str, float] = {}
        self.failures: Counter[str] = Counter()  # by name of the exception

    # Any thread ------------------------------------------------------------------------------

    def start(self) -> None:
        """Start the worker. Earlier submissions run first."""
        self._thread.start()

    def when_idle(self, function: Callable[[], None]) -> None:
        """Call `function` on the worker each time no work is left. To be set before `start`."""
        self._on_idle = function

    def stop(self) -> None:
        """Finish the submitted work, but no requests; returns when the thread has ended."""
        self.submit(self._stop)
        if self._thread.is_alive():
            self._thread.join()

    def slot(self) -> ExecutorSlot:
        return ExecutorSlot(self)

    def submit(self, function: Work, slot: ExecutorSlot | None = None) -> None:
        """Run `function(now_s)` on the worker's thread, after all earlier submissions."""
        self._queue.put((self._clock(), function, slot))

    def request(self, function: Work, slot: ExecutorSlot | None = None) -> None:
        """Run `function(now_s)` after all earlier requests, when no other work is left.

        A simulated world waits for submitted work, but not for requests: only REQUESTS_PER_STEP run
        in each step of its clock, so that a burst of them does not stop it.
        """
        if self._clock_notifies:
            self._requests.append((function, slot))
            self._queue.put(_WAKE)
        else:
            self.submit(function, slot)

    def call_every(self, period_s: float, function: Work) -> Callable[[], None]:
        """Call `function` once per period, first after one; returns a function to stop it."""
        periodic = _Periodic(period_s, function, self._clock() + period_s)
        slot = self.slot()
        slot.submit(lambda _now_s: slot.drive(periodic))
        return periodic.cancel

    def time_advanced(self) -> None:
        """The clock has advanced: check whether work has become due."""
        if self._requests or self._clock() >= self._next_due_s:
            self._queue.put(_WAKE)

    def lag_s(self, now_s: float) -> float:
        """How long the oldest unfinished work has waited at `now_s`, in seconds; 0: none."""
        return max(0.0, now_s - min(self._working_since_s, self._next_due_s))

    def take_worst_lag_s(self) -> float:
        """The longest delay of a timer since the last call of this function, in seconds."""
        worst_s, self._worst_lag_s = self._worst_lag_s, 0.0
        return worst_s

    # The worker ------------------------------------------------------------------------------

    def _work(self) -> None:
        deadlines = self._deadlines
        waiting: tuple[float, Work, ExecutorSlot | None] | None = None
        while not self._stopping:
            if waiting is None:
                block = not deadlines or deadlines[0][0] > self._clock()
                if block and self._queue.empty():
                    if self._may_serve():
                        self._serve()
                        continue
                    self._on_idle()
                    self.idle = True
                waiting = self._next_request(block)
                self.idle = False
            now_s = self._clock()
            due_s = deadlines[0][0] if deadlines else math.inf
            if due_s <= now_s and (waiting is None or due_s <= waiting[0]):
                self._tick_first(now_s)
            elif waiting is not None:
                submitted_s, function, slot = waiting
                waiting = None
                self._working_since_s = submitted_s
                self._run(function, now_s, slot)
            self._note_progress()

    def _note_progress(self) -> None:
        self._next_due_s = self._deadlines[0][0] if self._deadlines else math.inf
        self._working_since_s = math.inf

    def _may_serve(self) -> bool:
        """Whether a request waits that may run in this step of the clock."""
        if self._clock() > self._served_s:
            self._served = 0
        return bool(self._requests) and self._served < REQUESTS_PER_STEP

    def _serve(self) -> None:
        self._served_s = self._working_since_s = now_s = self._clock()
        self._served += 1
        function, slot = self._requests.popleft()
        self._run(function, now_s, slot)
        self._note_progress()

    def _next_request(self, block: bool) -> tuple[float, Work, ExecutorSlot | None] | None:
        """The next submitted function; None: check the deadlines again."""
        timeout_s = None
        if block and self._requests:
            timeout_s = REQUEST_PAUSE_S
        elif block and not self._clock_notifies and self._deadlines:
            timeout_s = max(0.0, self._deadlines[0][0] - self._clock())
        try:
            return self._queue.get(block, timeout_s)
        except queue.Empty:
            self._served = 0
            return None

    def _tick_first(self, now_s: float) -> None:
        due_s, _, slot = heapq.heappop(self._deadlines)
        if due_s != slot.scheduled_s:
            return  # it has been rescheduled
        slot.scheduled_s = math.inf
        self._working_since_s = due_s
        self._worst_lag_s = max(self._worst_lag_s, now_s - due_s)
        self._run(slot.tick, now_s, slot)

    def _run(self, function: Work, now_s: float, slot: ExecutorSlot | None) -> None:
        not_before_s = -math.inf
        try:
            function(now_s)
        except Exception as error:  # a failure of one node must not stop the others
            self._report(error, now_s)
            not_before_s = now_s + RETRY_AFTER_S
        if slot is not None and slot.next_tick_s != slot.scheduled_s:
            slot.scheduled_s = max(slot.next_tick_s, not_before_s)
            if slot.scheduled_s < math.inf:
                heapq.heappush(self._deadlines, (slot.scheduled_s, next(self._order), slot))

    def _stop(self, _now_s: float) -> None:
        self._stopping = True

    def _report(self, error: Exception, now_s: float) -> None:
        kind = type(error).__name__
        self.failures[kind] += 1
        if now_s - self._logged_s.get(kind, -math.inf) >= FAILURE_PERIOD_S:
            self._logged_s[kind] = now_s
            _log.error("%s in a mesh node (%d so far)", kind, self.failures[kind], exc_info=error)
