"""OrderlyStop: ends the program's own threads first, then ROS."""

from __future__ import annotations

import logging
import signal
import sys
import threading

import rospy

from drone_mesh.stopping import StopRequest

FINISH_TIMEOUT_S = 3.0  # our choice: `rosnode kill` waits this long (wall) for our threads


_log = logging.getLogger(__name__)


class OrderlyStop:
    """Context manager around a node's work, after init_node(..., disable_signals=True).

    rospy would close all topics as soon as Ctrl-C is pressed, while threads still publish. Instead,
    SIGINT, SIGTERM and `rosnode kill` only ask the main thread to leave the `with` block, in which
    it stops what it started; then ROS shuts down. After `fail` the program exits with code 1.
    Create it in the main thread.
    """

    def __init__(self) -> None:
        self._request = StopRequest()  # its pipe is open to the end of the program
        self._finished = threading.Event()
        self._failed = False

    def __enter__(self) -> OrderlyStop:
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, lambda _number, _frame: self._request.make())
        rospy.on_shutdown(self._on_shutdown)
        return self

    def __exit__(self, *exc: object) -> None:
        self._finished.set()
        rospy.signal_shutdown("finished")
        if self._failed and exc[0] is None:
            sys.exit(1)

    def fail(self, why: str) -> None:
        """Log this error, leave, and exit with code 1. Any thread."""
        _log.error("%s", why)
        self._failed = True
        self._request.make()

    def requested(self) -> bool:
        """Whether it is time to leave. Any thread."""
        return self._request.is_made()

    def wait(self, timeout_s: float) -> bool:
        """Wait at most `timeout_s` wall seconds; returns whether the program should stop."""
        return self._request.wait(timeout_s)

    def _on_shutdown(self) -> None:
        """In the thread of rospy that shuts the node down, before its topics are closed."""
        self._request.make()
        self._finished.wait(FINISH_TIMEOUT_S)
