"""Figures: measurements that a process publishes about its own work."""

from __future__ import annotations

import threading
from typing import Callable, Mapping

import rospy
from diagnostic_updater import DiagnosticStatusWrapper, Updater

HARDWARE_ID = "drone_mesh"
PERIOD_S = 1.0  # wall: diagnostics go on while simulated time stands still


class FiguresPublisher:
    """Publishes measurements once a second, in a thread of its own.

    Publishes: /diagnostics (DiagnosticArray), one status "<node>: <task>" with level OK
    """

    def __init__(self, task: str, take: Callable[[], Mapping[str, float]]) -> None:
        """`take` is called in the thread of this object."""
        self._take = take
        self._updater = Updater()
        self._updater.setHardwareID(HARDWARE_ID)
        self._updater.add(task, self._fill_in)
        self._stopped = threading.Event()
        self._thread = threading.Thread(target=self._run, name="figures", daemon=True)

    def start(self) -> None:
        """Start publishing."""
        self._thread.start()

    def stop(self) -> None:
        """Stop publishing; returns when the thread has ended."""
        self._stopped.set()
        if self._thread.is_alive():
            self._thread.join()

    def _run(self) -> None:
        while not self._stopped.wait(PERIOD_S) and not rospy.is_shutdown():
            try:
                self._updater.force_update()
            except rospy.ROSException:  # the topic was closed: the node shuts down
                return

    def _fill_in(self, status: DiagnosticStatusWrapper) -> DiagnosticStatusWrapper:
        status.summary(DiagnosticStatusWrapper.OK, "figures")
        for name, value in self._take().items():
            status.add(name, repr(value))
        return status
