"""Logging: the bridge from `logging` to /rosout, and throttled lines."""

from __future__ import annotations

import logging
import threading
import time

from drone_mesh.communication.timing import Throttle

COMPLAINT_PERIOD_S = 10.0  # one line per reason in this (wall) time


def show_library_logs_on_rosout() -> None:
    """Send the logs of drone_mesh to the handlers of rospy. Call once, after rospy.init_node()."""
    rosout = logging.getLogger("rosout")
    library = logging.getLogger("drone_mesh")
    library.handlers = list(rosout.handlers)
    library.setLevel(rosout.getEffectiveLevel())
    library.propagate = False


class ThrottledLog:
    """Counts messages by reason and logs each reason once per period. Any thread."""

    def __init__(self, log: logging.Logger) -> None:
        self._log = log
        self._lock = threading.Lock()  # guards the throttle
        self._throttle = Throttle(COMPLAINT_PERIOD_S)
        self.counts = self._throttle.counts

    def note(self, reason: str, text: str, level: int = logging.WARNING) -> None:
        """Count `reason`; log it with `text` unless it was logged within the last period."""
        with self._lock:
            is_due = self._throttle.count(reason, time.monotonic())
            count = self.counts[reason]
        if is_due:
            self._log.log(level, "%s: %s (%d so far)", reason, text, count)
