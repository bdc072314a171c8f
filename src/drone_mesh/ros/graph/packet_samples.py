"""PacketSamples: publishes a sample of the packets in the air while there is a subscriber."""

from __future__ import annotations

import random
import threading
import time

import rospy

from drone_mesh.msg import PacketSample
from drone_mesh.ros.graph import names
from drone_mesh.state.packets import PacketSampler

PERIOD_S = 0.2  # wall time; the frame period of the web console
QUEUE = 2  # samples that may wait for a slow subscriber
END_WITHIN_S = 1.0  # wall; our choice: several periods


class PacketSamples(rospy.SubscribeListener):
    """Publishes in a thread of its own, which sleeps while there is no subscriber.

    Publishes: /mesh/packets (PacketSample)

    Any thread may call `note`; `_lock` guards the sampler.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._sampler = PacketSampler(random.Random())  # affects only what is displayed
        self._watched = threading.Event()
        self._ended = threading.Event()
        self._publisher = rospy.Publisher(
            names.PACKETS_TOPIC, PacketSample, subscriber_listener=self, queue_size=QUEUE
        )
        self._thread = threading.Thread(target=self._run, name="packet samples", daemon=True)

    @property
    def watched(self) -> bool:
        """Whether there is a subscriber; only then is `note` worth a call."""
        return self._watched.is_set()

    def note(self, packet: bytes) -> None:
        """A packet was delivered."""
        with self._lock:
            self._sampler.note(packet, time.monotonic())

    def start(self) -> None:
        """Start publishing, until the node shuts down."""
        self._thread.start()
        rospy.on_shutdown(self._end)

    def _end(self) -> None:
        self._ended.set()
        self._watched.set()
        self._thread.join(END_WITHIN_S)

    def peer_subscribe(self, _topic: str, _publish: object, _peer_publish: object) -> None:
        """A subscriber has connected (a thread of rospy)."""
        self._watched.set()

    def peer_unsubscribe(self, _topic: str, peers: int) -> None:
        """A subscriber has left; `peers` remain (a thread of rospy)."""
        if not peers and not self._ended.is_set():
            self._watched.clear()

    def _run(self) -> None:
        while self._watched.wait() and not self._ended.wait(PERIOD_S):
            try:
                self._publisher.publish(self._message())
            except rospy.ROSException:  # the topic was closed: the node shuts down
                return

    def _message(self) -> PacketSample:
        with self._lock:
            carried, packets = self._sampler.take()
        now_s = time.monotonic()
        return PacketSample(
            carried=carried,
            senders=bytes(packet.sender for packet in packets),
            receivers=bytes(packet.receiver for packet in packets),
            types=bytes(packet.type for packet in packets),
            ages=[now_s - packet.at_s for packet in packets],
        )
