"""AntennaTopic: the topic of one antenna; reports truthfully whether a packet was received."""

from __future__ import annotations

import rospy

from drone_mesh.msg import NRF24
from drone_mesh.ros.graph.direct_publisher import DirectPublisher

STUCK_RECEIVER_S = 0.2  # our choice: a receiver that does not read for this long is disconnected


class AntennaTopic(DirectPublisher):
    """Publishes: the topic of one antenna, usually /Node/<id> (NRF24). Any thread."""

    def __init__(self, topic: str) -> None:
        self.has_listened = False  # set by rospy's thread: the first receiver has connected
        super().__init__(topic, NRF24, STUCK_RECEIVER_S)

    def peer_subscribe(self, topic: str, publish: object, peer_publish: object) -> None:
        """A receiver has connected (a thread of rospy)."""
        self.has_listened = True
        super().peer_subscribe(topic, publish, peer_publish)

    def deliver(self, message: NRF24) -> bool:
        """Publish this packet; returns False if there is no receiver."""
        if not self.has_subscriber():
            return False
        try:
            self.publish(message)
        except rospy.ROSException:  # the topic has been closed
            return False
        return bool(self.connections())
