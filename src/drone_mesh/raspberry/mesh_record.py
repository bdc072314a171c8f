"""MeshRecord: what a gateway knows of its mesh, once a second into a file (`--record`)."""

from __future__ import annotations

import json
import logging
import math
from collections import deque
from pathlib import Path
from typing import Any, Callable

from drone_mesh.errors import ConfigurationError
from drone_mesh.execution import Submit

PERIOD_S = 1.0

_log = logging.getLogger(__name__)


class MeshRecord:
    """Appends to the file; a failure to write ends the record, never the gateway.

    `check` and `close` are for one thread; the answers are made in the gateway's own.
    """

    def __init__(
        self,
        path: Path,
        submit: Submit,
        mesh: Callable[[int], dict[str, Any]],
    ) -> None:
        """`mesh` returns the state and the events after a number. Raises ConfigurationError."""
        self._path = path
        self._submit = submit
        self._mesh = mesh
        self._answers: deque[dict[str, Any]] = deque()
        self._last_event = 0
        self._due_s = -math.inf
        self._broken = False
        try:
            self._file = path.open("ab", buffering=0)
            if path.stat().st_size:
                self._file.write(b"\n")  # the last line may have been cut off
        except OSError as error:
            raise ConfigurationError(f"--record {path}: {error.strerror}") from error

    def check(self, now_s: float) -> None:
        """Write what has come, and ask for the next when it is due; to be called periodically."""
        self._write()
        if now_s >= self._due_s and not self._broken:
            self._due_s = now_s + PERIOD_S
            self._submit(self._answer)

    def close(self) -> None:
        """Write what has come, and close the file."""
        self._write()
        self._file.close()

    def _answer(self, _now_s: float) -> None:
        answer = self._mesh(self._last_event)
        self._last_event = max((event["number"] for event in answer["events"]), default=0) or (
            self._last_event
        )
        self._answers.append(answer)

    def _write(self) -> None:
        try:
            while self._answers and not self._broken:
                line = json.dumps(self._answers.popleft(), allow_nan=False) + "\n"
                self._file.write(line.encode())
        except OSError as error:
            self._broken = True
            _log.error("--record %s ends: %s", self._path, error.strerror)
