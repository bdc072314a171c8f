"""Figures: numbers that a process publishes about its own work."""

from __future__ import annotations

import threading
from typing import Callable, Mapping

import rospy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

from drone_mesh.ros.graph import names
from drone_mesh.ros.graph.conversions import ros_time

PERIOD_S = 1.0  # wall


class Figures:
    """Tells numbers once a second, in a thread of its own.

    Publishes: /diagnostics (DiagnosticArray), one status with level OK
    """

    def __init__(self, of: str, take: Callable[[], Mapping[str, float]]) -> None:
        """`take` is called in the thread of this object."""
        self._name = f"drone_mesh: {of}"
        self._take = take
        self._publisher = rospy.Publisher(names.DIAGNOSTICS_TOPIC, DiagnosticArray, queue_size=4)
        self._stopped = threading.Event()
        self._thread = threading.Thread(target=self._run, name="figures", daemon=True)

    def start(self) -> None:
        """Begin to publish."""
        self._thread.start()

    def stop(self) -> None:
        """Publish no more; returns when the thread has ended."""
        self._stopped.set()
        if self._thread.is_alive():
            self._thread.join()
        self._publisher.unregister()

    def _run(self) -> None:
        while not self._stopped.wait(PERIOD_S) and not rospy.is_shutdown():
            values = [KeyValue(name, repr(value)) for name, value in self._take().items()]
            array = DiagnosticArray()
            array.header.stamp = ros_time(rospy.get_time())
            array.status.append(
                DiagnosticStatus(
                    level=DiagnosticStatus.OK,
                    name=self._name,
                    message="figures",
                    hardware_id="drone_mesh",
                    values=values,
                )
            )
            try:
                self._publisher.publish(array)
            except rospy.ROSException:  # the node shuts down
                return
