"""The progress of the benchmark, on standard error."""

from __future__ import annotations

import time
from typing import TextIO

QUIET_S = 10.0  # without a terminal: at most one line in this time within a stage


class ProgressLine:
    """One updating line on a terminal; occasional lines in a file or pipe."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream
        self._live = stream.isatty()
        self._shown = ""
        self._shown_s = -QUIET_S
        self._width = 0

    def begin(self, text: str) -> None:
        """Begin a new stage; always printed, on its own line."""
        self.clear()
        print(text, file=self._stream, flush=True)
        self._shown, self._shown_s = text, time.monotonic()

    def say(self, text: str) -> None:
        """Show the progress within a stage."""
        if text == self._shown:
            return
        now_s = time.monotonic()
        if self._live:
            print(f"\r  {text:<{self._width}}", end="", file=self._stream, flush=True)
            self._width = len(text)
        elif now_s - self._shown_s >= QUIET_S:
            print(f"  {text}", file=self._stream, flush=True)
        else:
            return
        self._shown, self._shown_s = text, now_s

    def clear(self) -> None:
        """Remove the updating line."""
        if self._live and self._width:
            print(f"\r{'':<{self._width + 2}}\r", end="", file=self._stream, flush=True)
            self._width = 0
