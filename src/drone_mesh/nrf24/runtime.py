"""Time and threads as the driver sees them, so that it runs unchanged under emulated time."""

from __future__ import annotations

import abc
import threading
import time
from typing import Callable, ContextManager


class Task(abc.ABC):
    """Something that runs beside its creator."""

    @abc.abstractmethod
    def join(self) -> None:
        """Wait until it has ended."""


class Runtime(abc.ABC):
    """What the driver needs to wait, and to be used by several threads."""

    @abc.abstractmethod
    def now_s(self) -> float:
        """Seconds of a clock that never goes back."""

    @abc.abstractmethod
    def sleep(self, duration_s: float) -> None:
        """Let that much time pass, at least."""

    @abc.abstractmethod
    def lock(self) -> ContextManager[object]:
        """A new mutual exclusion lock, not reentrant."""

    @abc.abstractmethod
    def start(self, run: Callable[[], None], name: str) -> Task:
        """Run something beside the caller."""


class _ThreadTask(Task):
    def __init__(self, thread: threading.Thread) -> None:
        self._thread = thread

    def join(self) -> None:
        self._thread.join()


class SystemRuntime(Runtime):
    """The time and the threads of the machine."""

    def now_s(self) -> float:
        return time.monotonic()

    def sleep(self, duration_s: float) -> None:
        time.sleep(duration_s)

    def lock(self) -> ContextManager[object]:
        return threading.Lock()

    def start(self, run: Callable[[], None], name: str) -> Task:
        thread = threading.Thread(target=run, name=name, daemon=True)
        thread.start()
        return _ThreadTask(thread)
