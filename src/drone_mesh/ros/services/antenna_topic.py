"""AntennaTopic: the topic of one antenna, with the truth about whether a packet was received."""

from __future__ import annotations

import socket
import struct
import warnings

import rospy
from rospy.impl.transport import Transport

from drone_mesh.msg import NRF24

STUCK_RECEIVER_S = 0.2  # our choice: a receiver that does not read for this long is disconnected


class AntennaTopic(rospy.SubscribeListener):
    """Publishes: the topic of one antenna, usually /Node/<id> (NRF24). Any thread."""

    def __init__(self, topic: str) -> None:
        self.has_listened = False  # set by rospy's thread: the first receiver has connected
        with warnings.catch_warnings():
            # Synchronous on purpose: a queue costs a thread and two switches per packet, and hides
            # that the receiver is gone. peer_subscribe takes care of receivers that are stuck.
            warnings.simplefilter("ignore", SyntaxWarning)
            self._publisher = rospy.Publisher(
                topic, NRF24, subscriber_listener=self, tcp_nodelay=True, queue_size=None
            )

    def peer_subscribe(self, _topic: str, _publish: object, _peer_publish: object) -> None:
        """A stuck receiver may delay a sender only for a moment, then it is disconnected."""
        self.has_listened = True
        timeval = struct.pack("@ll", 0, int(STUCK_RECEIVER_S * 1e6))
        for connection in self._connections():
            if connection.socket is not None:
                connection.socket.setsockopt(socket.SOL_SOCKET, socket.SO_SNDTIMEO, timeval)

    def deliver(self, message: NRF24) -> bool:
        """Publish; False if there is no receiver."""
        if not self.has_receiver():
            return False
        try:
            self._publisher.publish(message)
        except rospy.ROSException:  # the topic was closed meanwhile
            return False
        return bool(self._connections())

    def has_receiver(self) -> bool:
        """Whether a process subscribes to the topic, and is still alive."""
        implementation = self._publisher.impl  # None once it is closed
        if implementation is None or not implementation.has_connections():
            return False
        # A killed process leaves its connection behind; rospy notices only at the second write.
        implementation.check()
        return bool(implementation.has_connections())

    def close(self) -> None:
        """Withdraw the topic."""
        self._publisher.unregister()

    def _connections(self) -> list[Transport]:
        implementation = self._publisher.impl
        return [] if implementation is None else implementation.connections
