"""The driver's time and threads, replaceable so that it runs in emulated time."""

from __future__ import annotations

import abc
import threading
import time
from typing import Callable, ContextManager, Protocol


class Task(Protocol):
    """A task that runs concurrently with its creator, such as a thread."""

    def join(self) -> None:
        """Wait until it has ended."""


class Signal(abc.ABC):
    """Makes waiting tasks evaluate their conditions again."""

    @abc.abstractmethod
    def wait_for(self, condition: Callable[[], bool], timeout_s: float) -> bool:
        """Return when the condition holds or the time is over; returns whether it holds.

        The condition is evaluated first, and again at each `notify`. The caller must not hold a
        lock.
        """

    @abc.abstractmethod
    def notify(self) -> None:
        """A condition may have changed."""


class Runtime(abc.ABC):
    """The time, locks and tasks that the driver uses."""

    @abc.abstractmethod
    def now_s(self) -> float:
        """Seconds of a clock that never goes back."""

    @abc.abstractmethod
    def sleep(self, duration_s: float) -> None:
        """Wait for at least this time."""

    @abc.abstractmethod
    def lock(self) -> ContextManager[object]:
        """A new mutual exclusion lock, not reentrant."""

    @abc.abstractmethod
    def signal(self) -> Signal:
        """A new signal."""

    @abc.abstractmethod
    def start(self, run: Callable[[], None], name: str) -> Task:
        """Run `run` concurrently with the caller."""


class ThreadSignal(Signal):
    """A signal between threads."""

    def __init__(self) -> None:
        self._condition = threading.Condition()

    def wait_for(self, condition: Callable[[], bool], timeout_s: float) -> bool:
        with self._condition:
            return self._condition.wait_for(condition, min(timeout_s, threading.TIMEOUT_MAX))

    def notify(self) -> None:
        with self._condition:
            self._condition.notify_all()


class SystemRuntime(Runtime):
    """The machine's time and threads."""

    def now_s(self) -> float:
        return time.monotonic()

    def sleep(self, duration_s: float) -> None:
        time.sleep(duration_s)

    def lock(self) -> ContextManager[object]:
        return threading.Lock()

    def signal(self) -> Signal:
        return ThreadSignal()

    def start(self, run: Callable[[], None], name: str) -> Task:
        thread = threading.Thread(target=run, name=name, daemon=True)
        thread.start()
        return thread
