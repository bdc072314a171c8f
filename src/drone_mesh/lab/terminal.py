"""What the lab shows on a terminal: its own name, and the progress of a batch."""

from __future__ import annotations

import os
import sys
import time
from pathlib import Path

_BY_FILE = {"drone-mesh-lab": "drone-mesh-lab", "lab": "rosrun drone_mesh lab"}


def _program() -> str:
    if "DRONE_MESH_LAB" in os.environ:  # by scripts/lab, which needs no installed package
        return os.environ["DRONE_MESH_LAB"]
    return _BY_FILE.get(Path(sys.argv[0]).name, "python3 -m drone_mesh.lab")


PROGRAM = _program()


TERMINAL_PERIOD_S = 0.5
LOG_PERIOD_S = 15.0


class Progress:
    """Prints the progress of a batch: runs done, rate, time left."""

    def __init__(self, missing: int) -> None:
        self.done = self.failed = 0
        self._missing = missing
        self._stream = sys.stderr
        self._on_terminal = self._stream.isatty()
        self._started_s = self._shown_s = time.monotonic()

    def count(self, failed: bool) -> None:
        self.done += 1
        self.failed += failed
        now_s = time.monotonic()
        if now_s - self._shown_s >= (TERMINAL_PERIOD_S if self._on_terminal else LOG_PERIOD_S):
            self._shown_s = now_s
            self._show()

    def close(self) -> None:
        self._show()
        if self._on_terminal:
            self._stream.write("\n")
            self._stream.flush()

    def _show(self) -> None:
        seconds = max(time.monotonic() - self._started_s, 1e-9)
        rate = self.done / seconds
        left = as_duration((self._missing - self.done) / rate) if rate else "?"
        text = f"{self.done} of {self._missing} runs, {rate:.1f}/s, {left} left"
        if self.failed:
            text += f", {self.failed} failed"
        self._stream.write(f"\r\033[K{text}" if self._on_terminal else f"{text}\n")
        self._stream.flush()


def as_duration(seconds: float) -> str:
    """For example: 40 s, 3 min 20 s, 2 h 5 min."""
    whole = round(seconds)
    if whole < 60:
        return f"{whole} s"
    if whole < 3600:
        return f"{whole // 60} min {whole % 60} s"
    return f"{whole // 3600} h {whole % 3600 // 60} min"
