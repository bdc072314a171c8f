"""Recording: reads a whole bag into the history of the pages while the bag is played."""

from __future__ import annotations

import itertools
import logging
import threading
import time
from functools import partial
from pathlib import Path
from typing import Sequence

from drone_mesh.console.history import History
from drone_mesh.console.runner import ConsoleRunner
from drone_mesh.ros.views.bag import BagUnusable, RecordedMesh
from drone_mesh.state.model import MeshStatus

STATES_AT_ONCE = 10  # 254 nodes keep the server's loop busy for some 50 ms
LOOP_LIMIT_S = 10.0  # wall time in which the loop must accept them

_log = logging.getLogger(__name__)


class Recording:
    """Reads in a thread of its own. `history` belongs to the runner's loop, which fills it."""

    def __init__(self, path: Path, history: History, runner: ConsoleRunner) -> None:
        self._path, self._history, self._runner = path, history, runner
        self._stopped = threading.Event()
        self._thread = threading.Thread(target=self._run, name="recording", daemon=True)

    def start(self) -> None:
        """Start reading; the runner must be serving."""
        self._thread.start()

    def stop(self) -> None:
        """Stop reading; returns when the thread has ended."""
        self._stopped.set()
        self._thread.join()

    def _run(self) -> None:
        begun_s = time.monotonic()
        recorded = RecordedMesh(self._path)
        try:
            events = sorted(recorded.events(), key=lambda event: event.stamp_s)
            self._runner.in_loop(lambda: self._history.add_events(events))
            states = recorded.states()
            while batch := list(itertools.islice(states, STATES_AT_ONCE)):
                self._hand_over(batch)
                if self._stopped.is_set():
                    return
            packets = list(recorded.packets())
        except BagUnusable as error:
            _log.warning("the time line stays empty: %s", error)
            return
        for damage in recorded.damage:
            _log.warning("%s", damage)
        self._runner.in_loop(partial(self._history.add_packets, packets))
        took_s = time.monotonic() - begun_s
        _log.info("%s: completely on the time line after %.1f s", self._path, took_s)

    def _hand_over(self, states: Sequence[MeshStatus]) -> None:
        """Add these states in the loop and wait for it, so that no work piles up there."""
        done = threading.Event()

        def extend() -> None:
            self._history.extend(states)
            done.set()

        self._runner.in_loop(extend)
        done.wait(LOOP_LIMIT_S)
