"""ConsoleMemory: what the console remembers survives it, in a parameter."""

from __future__ import annotations

import logging
import time

import rospy

from drone_mesh.console.frame_store import FrameStore
from drone_mesh.console.memory import Memory, pack, unpack
from drone_mesh.ros.graph import names
from drone_mesh.ros.graph.bounded_master import NO_ANSWER
from drone_mesh.ros.graph.run import Run

SAVE_PERIOD_S = 10.0  # wall; what nobody waits for, the samples of the charts

log = logging.getLogger(__name__)


class ConsoleMemory:
    """Parameter: /drone_mesh/console_memory, what a console of this run has shown.

    `recall` and `collect` belong to the loop of the store, the rest to the main thread. `_unsaved`
    passes from one to the other.
    """

    def __init__(self, store: FrameStore) -> None:
        """Read what a console before this one has left."""
        self._store = store
        self._left = _read()
        self._run: Run = ""
        self._unsaved: Memory | None = None
        self._noted_at = 0
        self._collected_s = float("-inf")

    def recall(self, run: Run) -> None:
        """The run is known: go on if the memory is of the same one, else forget what is shown."""
        if self._run:
            self._store.restart(())
        self._run, left, self._left = run, self._left, None
        if left is None or not run or left.run != run:
            return
        try:
            self._store.restore(left.saved)
        except (KeyError, TypeError, ValueError) as error:
            log.warning("console: parameter %s is ignored: %s", names.CONSOLE_MEMORY_PARAM, error)

    def collect(self) -> None:
        """Take what is worth saving now."""
        now_s, noted_at = time.monotonic(), self._store.noted_at
        if self._run and (noted_at != self._noted_at or now_s - self._collected_s > SAVE_PERIOD_S):
            self._noted_at, self._collected_s = noted_at, now_s
            self._unsaved = Memory(self._run, self._store.saved())

    def save(self) -> None:
        """Save what was collected."""
        memory, self._unsaved = self._unsaved, None
        if memory is None:
            return
        try:
            rospy.set_param(names.CONSOLE_MEMORY_PARAM, pack(memory))
        except NO_ANSWER as error:
            log.debug("console: what the page shows is not saved: %s", error)


def _read() -> Memory | None:
    try:
        text = rospy.get_param(names.CONSOLE_MEMORY_PARAM, "")
        return unpack(str(text)) if text else None
    except (ValueError, *NO_ANSWER) as error:
        log.warning("console: parameter %s is ignored: %s", names.CONSOLE_MEMORY_PARAM, error)
        return None
