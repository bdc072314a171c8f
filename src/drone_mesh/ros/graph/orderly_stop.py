"""OrderlyStop: ends the program's own threads first, then ROS."""

from __future__ import annotations

import _thread
import logging
import os
import signal
import socket
import sys
import threading

import rospy

from drone_mesh.ros.graph.master import NO_ANSWER, bounded_master
from drone_mesh.stopping import StopRequest

MASTER_TIMEOUT_S = 2.0  # wall: asked twice, a master that is silent for so long hangs
FINISH_TIMEOUT_S = 3.0  # `rosnode kill` waits this long (wall) for our threads


_log = logging.getLogger(__name__)


def end_without_dead_master() -> None:
    """Call when the program was told to end: ROS would wait for a master that hangs for ever.

    Signal handlers call it: Thread.start would wait, with locks that the interrupted code may hold.
    """
    _thread.start_new_thread(_end_without_dead_master, ())


def _end_without_dead_master() -> None:
    for _try in range(2):
        try:
            bounded_master(rospy.get_name(), MASTER_TIMEOUT_S).getPid()
        except socket.timeout:
            continue
        except NO_ANSWER:
            pass  # it has ended, and nobody waits for it
        return
    print(f"{rospy.get_name()}: the ROS master does not answer: ending without it", file=sys.stderr)
    os._exit(1)


class OrderlyStop:
    """Context manager around a node's work; its init_node needs disable_signals=True.

    rospy would close all topics as soon as Ctrl-C is pressed, while threads still publish. Instead,
    SIGINT, SIGTERM and `rosnode kill` only ask the main thread to leave the `with` block, in which
    it stops what it started; then ROS shuts down. After `fail` the program exits with code 1, after
    `begin_anew` it starts again. Create it in the main thread.
    """

    def __init__(self) -> None:
        self._request = StopRequest()  # its pipe is open to the end of the program
        self._finished = threading.Event()
        self._failed = self._begins_anew = False
        self._told = False  # from outside

    def __enter__(self) -> OrderlyStop:
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, lambda _number, _frame: self._tell())
        rospy.on_shutdown(self._on_shutdown)
        return self

    def __exit__(self, *exc: object) -> None:
        self._finished.set()
        rospy.signal_shutdown("finished")
        if exc[0] is not None:
            return
        if self._failed:
            sys.exit(1)
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, signal.SIG_DFL)
        if self._begins_anew and not self._told:
            sys.stdout.flush()
            os.execv(sys.executable, [sys.executable, *sys.argv])

    def fail(self, why: str) -> None:
        """Log this error, leave, and exit with code 1. Any thread."""
        _log.error("%s", why)
        self._failed = True
        self._request.make()

    def begin_anew(self) -> None:
        """Leave, and start this program again, for another world. Any thread."""
        if not self._begins_anew:
            self._begins_anew = True
            _log.warning("another world has begun: %s begins anew", rospy.get_name())
            self._request.make()

    def requested(self) -> bool:
        """Whether it is time to leave. Any thread."""
        return self._request.is_made()

    def wait(self, timeout_s: float | None = None) -> bool:
        """Wait, at most `timeout_s` wall seconds if given; returns whether to stop."""
        return self._request.wait(timeout_s)

    def _on_shutdown(self) -> None:
        """In the thread of rospy that shuts the node down, before its topics are closed."""
        if not self._finished.is_set():
            self._tell()
            self._finished.wait(FINISH_TIMEOUT_S)

    def _tell(self) -> None:
        self._request.make()
        if not self._told:
            self._told = True
            end_without_dead_master()
