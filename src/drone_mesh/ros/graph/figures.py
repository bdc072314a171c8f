"""Figures: measurements that a process publishes about its own work."""

from __future__ import annotations

from typing import Callable, Mapping

from diagnostic_updater import DiagnosticStatusWrapper, Updater

from drone_mesh.ros.graph.periodic import Periodic

HARDWARE_ID = "drone_mesh"
PERIOD_S = 1.0  # wall: diagnostics go on while simulated time stands still

# Names of figures that several processes or their readers share.
DELIVERED = "delivered"  # packets handed to a node, counting each receiver of a broadcast
LOST_IN_RANGE = "lost in range"  # packets for a node that is on, in range and has listened before
WORST_LAG = "worst timer lag"  # s, simulated: the longest delay of a timer since the last report


class FiguresPublisher(Periodic):
    """Publishes measurements once a second, in a thread of its own.

    Publishes: /diagnostics (DiagnosticArray), one status "<node>: <task>" with level OK
    """

    def __init__(self, task: str, measure: Callable[[], Mapping[str, float]]) -> None:
        """`measure` is called in the thread of this object."""
        super().__init__("figures", PERIOD_S)
        self._measure = measure
        self._updater = Updater()
        self._updater.setHardwareID(HARDWARE_ID)
        self._updater.add(task, self._fill_in)

    def _work(self) -> None:
        self._updater.force_update()

    def _fill_in(self, status: DiagnosticStatusWrapper) -> DiagnosticStatusWrapper:
        status.summary(DiagnosticStatusWrapper.OK, "figures")
        for name, value in self._measure().items():
            status.add(name, repr(value))
        return status
