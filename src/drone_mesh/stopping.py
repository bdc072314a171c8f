"""StopRequest: how a signal handler asks a program to end."""

from __future__ import annotations

import os
import select
from types import TracebackType


class StopRequest:
    """Made once, by a signal handler or any thread; wakes all threads that wait for it.

    A threading.Event does not suit a signal handler: it has a lock, and the handler may interrupt
    the very thread that holds it. Here the request is a byte in a pipe that is never read, so every
    thread that waits sees it, now or later. Close it when no thread uses it any more.
    """

    def __init__(self) -> None:
        self._made = False
        self._read_end, self._write_end = os.pipe()

    def __enter__(self) -> StopRequest:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.close()

    def make(self) -> None:
        """Ask the program to end. Any thread, any signal handler; later calls change nothing."""
        if not self._made:
            self._made = True
            os.write(self._write_end, b"\0")

    def is_made(self) -> bool:
        """Whether the program was asked to end. Any thread."""
        return self._made

    def wait(self, timeout_s: float) -> bool:
        """Wait at most `timeout_s` seconds; returns whether the request was made. Any thread."""
        if not self._made:
            poll = select.poll()  # select() takes no file descriptor above 1023
            poll.register(self._read_end, select.POLLIN)
            poll.poll(max(0.0, timeout_s) * 1000.0)
        return self._made

    def close(self) -> None:
        """Release the pipe; `is_made` keeps its value."""
        self._made = True
        os.close(self._read_end)
        os.close(self._write_end)
