"""Periodic: work that a node repeats in a thread of its own."""

from __future__ import annotations

import abc
import threading

import rospy


class Periodic(abc.ABC):
    """Calls `_work` once per period of wall time, until it is stopped or the node shuts down."""

    def __init__(self, name: str, period_s: float) -> None:
        """`name`: of the thread."""
        self._period_s = period_s
        self._stopped = threading.Event()
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)

    def start(self) -> None:
        """Start the thread."""
        self._thread.start()

    def stop(self) -> None:
        """End the thread, which may not have been started; returns when it has ended."""
        self._stopped.set()
        if self._thread.is_alive():
            self._thread.join()

    @abc.abstractmethod
    def _work(self) -> None:
        """The work that the thread repeats."""

    def _run(self) -> None:
        while not (self._stopped.wait(self._period_s) or rospy.is_shutdown()):
            try:
                self._work()
            except rospy.ROSException:  # a topic was closed: the node shuts down
                if not rospy.is_shutdown():
                    raise
