"""Work that a node repeats in a thread of its own: figures about itself, samples of packets."""

from __future__ import annotations

import abc
import random
import threading
import time
from typing import Callable, Mapping

import rospy
from diagnostic_updater import DiagnosticStatusWrapper, Updater

from drone_mesh.msg import PacketSample
from drone_mesh.ros.graph import names
from drone_mesh.state.packets import PacketSampler

HARDWARE_ID = "drone_mesh"
# Names of figures that several processes or their readers share.
DELIVERED = "delivered"  # packets handed to a node, counting each receiver of a broadcast
LOST_IN_RANGE = "lost in range"  # packets for a node that is on, in range and has listened before
WORST_LAG = "worst timer lag"  # s, simulated: the longest delay of a timer since the last report
FIGURES_PERIOD_S = 1.0  # wall: diagnostics go on while simulated time stands still
SAMPLES_PERIOD_S = 0.2  # wall; the frame period of the web console
SAMPLES_QUEUE = 2  # that may wait for a slow subscriber


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
            except rospy.ROSException:  # topics close before is_shutdown says so
                if not rospy.core.is_shutdown_requested():
                    raise


class FiguresPublisher(Periodic):
    """Publishes measurements once a second, in a thread of its own.

    Publishes: /diagnostics (DiagnosticArray), one status "<node>: <task>" with level OK
    """

    def __init__(self, task: str, measure: Callable[[], Mapping[str, float]]) -> None:
        """`measure` is called in the thread of this object."""
        super().__init__("figures", FIGURES_PERIOD_S)
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


class PacketSamples(Periodic):
    """Publishes in a thread of its own, while there is a subscriber.

    Publishes: /mesh/packets (PacketSample)

    Any thread may call `note`; `_lock` guards the sampler.
    """

    def __init__(self) -> None:
        super().__init__("packet samples", SAMPLES_PERIOD_S)
        self._lock = threading.Lock()
        self._sampler = PacketSampler(random.Random())  # affects only what is displayed
        self._publisher = rospy.Publisher(
            names.PACKETS_TOPIC, PacketSample, queue_size=SAMPLES_QUEUE
        )

    @property
    def watched(self) -> bool:
        """Whether there is a subscriber; only then is `note` worth a call."""
        return bool(self._publisher.get_num_connections())

    def note(self, packet: bytes) -> None:
        with self._lock:
            self._sampler.note(packet, time.monotonic())

    def start(self) -> None:
        super().start()
        rospy.on_shutdown(self.stop)

    def _work(self) -> None:
        with self._lock:  # always: a later subscriber must not get what is left from before
            carried, packets = self._sampler.drain()
        if not self.watched:
            return
        now_s = time.monotonic()
        self._publisher.publish(
            PacketSample(
                carried=carried,
                senders=bytes(packet.sender for packet in packets),
                receivers=bytes(packet.receiver for packet in packets),
                types=bytes(packet.type for packet in packets),
                ages=[now_s - packet.at_s for packet in packets],
            )
        )
