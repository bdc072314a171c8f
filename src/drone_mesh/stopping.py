"""How programs start and end: a missing extra, StopRequest, errors, Ctrl-C, a closed pipe."""

from __future__ import annotations

import contextlib
import errno
import functools
import gc
import io
import math
import os
import select
import signal
import sys
import threading
import time
from typing import Any, Callable, Iterator, TypeVar, cast

from drone_mesh.errors import MeshError


@contextlib.contextmanager
def loading() -> Iterator[None]:
    """What is imported meanwhile stays until the program ends, so no garbage is looked for in it.

    Python would look through the new modules again and again while they load, and through all at
    the end: a quarter of the processor time of a short program with ROS.
    """
    gc.disable()
    try:
        yield
    finally:
        gc.freeze()
        gc.enable()


def run_with_extra(program: str, extra: str, load: Callable[[], Callable[[], int]]) -> int:
    """Run what `load` imports; the exit status, 1 if a package is missing."""
    before = signal.signal(signal.SIGINT, signal.SIG_DFL)  # Ctrl-C leaves no traceback
    try:
        with loading():
            main = load()
    except ImportError as error:
        print(
            f"{program} needs the Python package {error.name}: pip install 'drone_mesh[{extra}]'",
            file=sys.stderr,
        )
        return 1
    finally:
        signal.signal(signal.SIGINT, before)
    return main()


INTERRUPTED = 130  # exit status, as in a shell for SIGINT
CLOSED_PIPE = 141  # as in a shell for SIGPIPE

# Python handles a signal in the main thread, after its system call. Nothing interrupts that call if
# the signal comes just before it, or if the kernel gives the signal to another thread.
HANDLER_LATENCY_S = 0.5

Main = TypeVar("Main", bound=Callable[..., int])


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

    def __exit__(self, *_error: object) -> None:
        self.close()

    def make(self) -> None:
        """Ask the program to end. Any thread, any signal handler; later calls change nothing."""
        if not self._made:
            self._made = True
            os.write(self._write_end, b"\0")

    def is_made(self) -> bool:
        """Whether the program was asked to end. Any thread."""
        return self._made

    def wait(self, timeout_s: float | None = None) -> bool:
        """Wait, at most `timeout_s` seconds if given; returns whether it was made. Any thread."""
        poll = select.poll()  # select() takes no file descriptor above 1023
        if not self._made:
            poll.register(self._read_end, select.POLLIN)
        deadline_s = math.inf if timeout_s is None else time.monotonic() + timeout_s
        while not self._made:
            left_s = deadline_s - time.monotonic()
            if not poll.poll(1000.0 * max(0.0, min(left_s, HANDLER_LATENCY_S))) and left_s <= 0.0:
                break
        return self._made

    def close(self) -> None:
        """Release the pipe; `is_made` keeps its value."""
        self._made = True
        os.close(self._read_end)
        os.close(self._write_end)


@contextlib.contextmanager
def ignored(*signals: signal.Signals) -> Iterator[None]:
    """Ignore these signals meanwhile. Has no effect outside the main thread, where none arrives."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    handlers = {number: signal.signal(number, signal.SIG_IGN) for number in signals}
    try:
        yield
    finally:
        for number, handler in handlers.items():
            signal.signal(number, handler)


def ends_as(program: str, failed: int = 1) -> Callable[[Main], Main]:
    """Decorates `main` of a program, which returns its exit status.

    A MeshError or a full disk becomes one line, and the status `failed`. The program ends quietly
    on Ctrl-C, and when the reader of its output has ended. During its imports, SIGINT may have
    ended it at once.
    """

    def decorate(main: Main) -> Main:
        @functools.wraps(main)
        def ending_main(*args: Any, **kwargs: Any) -> int:
            if signal.getsignal(signal.SIGINT) is signal.SIG_DFL:
                signal.signal(signal.SIGINT, signal.default_int_handler)
            out = sys.stdout  # None: the program was started without one
            if isinstance(out, io.TextIOWrapper) and out.errors == "strict":
                out.reconfigure(errors="backslashreplace")  # as stderr: a name may be in any bytes
            try:
                try:
                    return main(*args, **kwargs)
                except MeshError as error:
                    print(f"{program}: {error}", file=sys.stderr)
                    return failed
                except KeyboardInterrupt:
                    return INTERRUPTED
                finally:
                    if out is not None:
                        out.flush()
            except OSError as error:
                if out is None or error.errno not in (errno.EPIPE, errno.ENOSPC):
                    raise
                # Or else the interpreter would try once more to write what is left, and complain.
                os.dup2(os.open(os.devnull, os.O_WRONLY), out.fileno())
                if error.errno == errno.EPIPE:
                    return CLOSED_PIPE
                print(f"{program}: {error.strerror}", file=sys.stderr)
                return failed

        return cast(Main, ending_main)

    return decorate
