"""PacketSamples: publishes a sample of the packets in the air while there is a subscriber."""

from __future__ import annotations

import random
import threading
import time

import rospy

from drone_mesh.msg import PacketSample
from drone_mesh.ros.graph import names
from drone_mesh.ros.graph.periodic import Periodic
from drone_mesh.state.packets import PacketSampler

PERIOD_S = 0.2  # wall time; the frame period of the web console
QUEUE = 2  # samples that may wait for a slow subscriber


class PacketSamples(Periodic):
    """Publishes in a thread of its own, while there is a subscriber.

    Publishes: /mesh/packets (PacketSample)

    Any thread may call `note`; `_lock` guards the sampler.
    """

    def __init__(self) -> None:
        super().__init__("packet samples", PERIOD_S)
        self._lock = threading.Lock()
        self._sampler = PacketSampler(random.Random())  # affects only what is displayed
        self._publisher = rospy.Publisher(names.PACKETS_TOPIC, PacketSample, queue_size=QUEUE)

    @property
    def watched(self) -> bool:
        """Whether there is a subscriber; only then is `note` worth a call."""
        return bool(self._publisher.get_num_connections())

    def note(self, packet: bytes) -> None:
        """A packet was delivered."""
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
