"""DirectPublisher: publishes in the caller's thread, disconnects subscribers that do not read."""

from __future__ import annotations

import socket
import struct
import warnings

import rospy
from genpy import Message
from rospy.impl.transport import Transport


class DirectPublisher(rospy.SubscribeListener):
    """A publisher without queues, for topics that carry many small messages. Any thread.

    rospy's queue costs a thread per subscriber and two context switches per message, and does not
    report that a subscriber has gone. Without a queue, a subscriber that stops reading blocks the
    caller once the kernel's buffers are full: for `limit_s` at most, then it is disconnected.
    """

    def __init__(
        self,
        topic: str,
        data_class: type[Message],
        limit_s: float,
        headers: dict[str, str] | None = None,
    ) -> None:
        """`limit_s`: wall seconds, below 1, for which one send may block.

        `headers`: further ones of its connections.
        """
        self.had_subscriber = False  # set by a thread of rospy: the first one has connected
        self._timeval = struct.pack("@ll", 0, int(limit_s * 1e6))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", SyntaxWarning)  # rospy warns about queue_size
            self._publisher = rospy.Publisher(
                topic,
                data_class,
                subscriber_listener=self,
                tcp_nodelay=True,
                headers=headers,
                queue_size=None,
            )

    def peer_subscribe(self, _topic: str, _publish: object, _peer_publish: object) -> None:
        """A new subscriber (a thread of rospy): limit how long it can block."""
        self.had_subscriber = True
        for connection in self.connections():
            if connection.socket is not None:
                connection.socket.setsockopt(socket.SOL_SOCKET, socket.SO_SNDTIMEO, self._timeval)

    def publish(self, message: Message) -> None:
        """Send to all subscribers. Raises ROSException once the topic is closed."""
        self._publisher.publish(message)

    def deliver(self, message: Message) -> bool:
        """Like `publish`; returns False if there is no subscriber, or the topic is closed."""
        if not self.has_subscriber():
            return False
        try:
            self.publish(message)
        except rospy.ROSException:
            return False
        return bool(self.connections())

    def has_subscriber(self) -> bool:
        """Whether any subscriber is connected and alive."""
        implementation = self._publisher.impl  # None once it is closed
        if implementation is None or not implementation.has_connections():
            return False
        # A killed process leaves its connection behind; rospy notices only at the second write.
        implementation.check()
        return bool(implementation.has_connections())

    def connections(self) -> list[Transport]:
        implementation = self._publisher.impl
        return [] if implementation is None else implementation.connections

    def close(self) -> None:
        self._publisher.unregister()
