"""What the benchmark is doing, for those who wait: on standard error."""

from __future__ import annotations

import time
from typing import TextIO

QUIET_S = 10.0  # without a terminal: one line in this time, unless something new begins


class Progress:
    """One line that changes on a terminal; a line now and then in a file or pipe."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream
        self._live = stream.isatty()
        self._said = ""
        self._said_s = -QUIET_S
        self._width = 0

    def begin(self, text: str) -> None:
        """Something new begins: always said, on a line of its own."""
        self.clear()
        print(text, file=self._stream, flush=True)
        self._said, self._said_s = text, time.monotonic()

    def say(self, text: str) -> None:
        """How far it is."""
        if text == self._said:
            return
        now_s = time.monotonic()
        if self._live:
            print(f"\r  {text:<{self._width}}", end="", file=self._stream, flush=True)
            self._width = len(text)
        elif now_s - self._said_s >= QUIET_S:
            print(f"  {text}", file=self._stream, flush=True)
        else:
            return
        self._said, self._said_s = text, now_s

    def clear(self) -> None:
        """Remove the changing line."""
        if self._live and self._width:
            print(f"\r{'':<{self._width + 2}}\r", end="", file=self._stream, flush=True)
            self._width = 0
