"""WirelessSignalSimulator: the simulated air as a ROS node.

docs/ros.md, "Wireless signal simulator".
"""

from __future__ import annotations

import logging
import threading

import rospy
from std_msgs.msg import Bool

from drone_mesh import srv
from drone_mesh.air.node_table import AirError, NodeTable
from drone_mesh.air.obstacles import Obstacles
from drone_mesh.communication.interfaces import PAYLOAD_BYTES
from drone_mesh.communication.wire.messages import readdressed, receiver
from drone_mesh.msg import NRF24, DroneInfo
from drone_mesh.ros.graph import names
from drone_mesh.ros.graph.command_line import start_node
from drone_mesh.ros.graph.direct_publisher import DirectPublisher
from drone_mesh.ros.graph.logs import ThrottledLog, show_library_logs_on_rosout
from drone_mesh.ros.graph.master import MasterWatch
from drone_mesh.ros.graph.parameters import configured_obstacles, factory_configuration, or_exit
from drone_mesh.ros.graph.periodic import DELIVERED, LOST_IN_RANGE, FiguresPublisher, PacketSamples

STUCK_RECEIVER_S = 0.2  # a receiver that does not read for this long is disconnected

_log = logging.getLogger(__name__)


class WirelessSignalSimulator:
    """The simulated air: knows the position of each antenna and delivers packets within range.

    Parameters (private): ~max_distance (float, metres), ~obstacles (the path of a file of boxes)
                and ~obstacle_radio (block or wall), overriding the YAML file in ~config
                (config/factory.yaml by default)
    Subscribes: /WirelessSignalSimulator (DroneInfo), /jammer (Bool: while true, no packet arrives)
    Publishes:  the topic in each antenna's DroneInfo, usually /Node/<id> (NRF24); while there is
                a subscriber, a sample of all packets on /mesh/packets (PacketSample)
    Services:   /SignalSimulator/message (WirelessMessage), /SignalSimulator/othersinRange
                (AreaScan), /SignalSimulator/messages (WirelessMessages),
                /SignalSimulator/broadcast (Broadcast)
    Figures:    delivered, lost in range, on /diagnostics
    """

    # The handlers run in the threads of rospy's connections. `_lock` guards the node table, the
    # rays that it casts and the counts, and is never held during a send. `_opening` guards the set
    # of topics and admits one antenna's DroneInfo at a time, so that the open topic is always the
    # one in the node table.

    def __init__(self, max_distance_m: float, obstacles: Obstacles | None = None) -> None:
        """`obstacles` as for NodeTable. Raises AirError for an invalid distance."""
        self._nodes = NodeTable(max_distance_m, obstacles)
        self._lock = threading.Lock()
        self._opening = threading.Lock()
        self._antenna_topics: dict[str, DirectPublisher] = {}
        self._topics: dict[int, str] = {}  # the topic of each registered node; under _opening
        self._throttled_log = ThrottledLog(_log)
        self._delivered = self._lost = 0
        self._jammed = False  # set by a thread of rospy
        self._samples = PacketSamples()
        self._samples.start()
        # The services first: a host that sees the subscription may call at once.
        rospy.Service(names.MESSAGE_SERVICE, srv.WirelessMessage, self._message)
        rospy.Service(names.MESSAGES_SERVICE, srv.WirelessMessages, self._messages)
        rospy.Service(names.OTHERS_IN_RANGE_SERVICE, srv.AreaScan, self._others_in_range)
        rospy.Service(names.BROADCAST_SERVICE, srv.Broadcast, self._broadcast)
        rospy.Subscriber(names.SIGNAL_TOPIC, DroneInfo, self._drone_info, tcp_nodelay=True)
        rospy.Subscriber(names.JAMMER_TOPIC, Bool, self._jam)
        FiguresPublisher("air", self._figures).start()

    def _jam(self, on: Bool) -> None:
        self._jammed = on.data
        _log.info("a jammer is %s", "on" if on.data else "off")

    def _drone_info(self, info: DroneInfo) -> None:
        try:
            if info.sub:
                self._antenna_info(info)
            else:
                self._note(info)
        except AirError as error:
            self._throttled_log.note("DroneInfo dropped", str(error))

    def _antenna_info(self, info: DroneInfo) -> None:
        self._check_topic_type(info)
        with self._opening:
            self._note(info)
            old_topic = self._open(info.nodeID, info.sub)
        if old_topic is not None:
            self._throttled_log.note(
                "topic changed", f"node {info.nodeID}: from {old_topic} to {info.sub}"
            )

    def _note(self, info: DroneInfo) -> None:
        with self._lock:
            self._nodes.drone_info(info.nodeID, info.position, info.sub, info.on)

    def _open(self, node_id: int, topic: str) -> str | None:
        """Open the node's topic; returns the topic that it replaces, or None."""
        old_topic = self._topics.get(node_id)
        if topic == old_topic:
            return None
        self._topics[node_id] = topic
        if topic not in self._antenna_topics:
            self._antenna_topics[topic] = DirectPublisher(topic, NRF24, STUCK_RECEIVER_S)
        # An antenna's usual topic stays open: redirecting its packets for a moment must not
        # cost it the connection.
        usual = (_usual_topic(node) for node in self._topics)
        if old_topic is not None and old_topic not in {*usual, *self._topics.values()}:
            self._antenna_topics.pop(old_topic).close()
        _log.debug("node %d listens on %s", node_id, topic)
        return old_topic

    def _check_topic_type(self, info: DroneInfo) -> None:
        """Refuse to publish packets on a topic of another type, such as /clock."""
        if info.sub in self._antenna_topics or info.sub == _usual_topic(info.nodeID):
            return
        for topic, kind in rospy.get_published_topics():
            if topic == rospy.resolve_name(info.sub) and kind != NRF24._type:
                raise AirError(f"node {info.nodeID}: {info.sub[:60]} is a topic of type {kind}")

    def _message(self, request: srv.WirelessMessageRequest) -> srv.WirelessMessageResponse:
        with self._lock:
            topic = self._nodes.link(request.from_, request.to)
        if topic is None:
            return srv.WirelessMessageResponse(False)
        if request.from_ == request.to:  # an antenna's probe for its own registration
            listener = self._antenna_topics.get(topic)
            taken = listener is not None and listener.deliver(request.message)
            return srv.WirelessMessageResponse(taken)
        return srv.WirelessMessageResponse(self._carry(topic, request.message))

    def _messages(self, request: srv.WirelessMessagesRequest) -> srv.WirelessMessagesResponse:
        joined = request.packets
        if len(joined) % PAYLOAD_BYTES:
            raise rospy.ServiceException(
                f"invalid packets of {len(joined)} bytes: expected {PAYLOAD_BYTES} per packet"
            )
        packets = [joined[at : at + PAYLOAD_BYTES] for at in range(0, len(joined), PAYLOAD_BYTES)]
        with self._lock:
            topics = [self._nodes.link(request.from_, receiver(packet)) for packet in packets]
        hops = zip(packets, topics)
        return srv.WirelessMessagesResponse(
            [topic is not None and self._carry(topic, NRF24(packet)) for packet, topic in hops]
        )

    def _broadcast(self, request: srv.BroadcastRequest) -> srv.BroadcastResponse:
        packet, topics = request.message.payload, self._topics_in_range(request.from_)

        def takes(node: int, topic: str | None) -> bool:
            return topic is not None and self._carry(topic, NRF24(readdressed(packet, node)))

        return srv.BroadcastResponse([node for node, topic in topics if takes(node, topic)])

    def _others_in_range(self, request: srv.AreaScanRequest) -> srv.AreaScanResponse:
        topics = self._topics_in_range(request.id)
        return srv.AreaScanResponse([node for node, topic in topics if self._is_heard(topic)])

    def _topics_in_range(self, node_id: int) -> list[tuple[int, str | None]]:
        with self._lock:
            try:
                nodes = self._nodes.in_range(node_id)
            except AirError as error:
                raise rospy.ServiceException(str(error)) from None
            return [(node, self._nodes.link(node_id, node)) for node in nodes]

    def _is_heard(self, topic: str | None) -> bool:
        listener = None if topic is None else self._antenna_topics.get(topic)
        return listener is not None and listener.has_subscriber()

    def _carry(self, topic: str, message: NRF24) -> bool:
        listener = self._antenna_topics.get(topic)
        delivered = not self._jammed and listener is not None and listener.deliver(message)
        if delivered and self._samples.watched:
            self._samples.note(message.payload)
        with self._lock:
            if delivered:
                self._delivered += 1
            elif listener is not None and listener.had_subscriber:
                self._lost += 1  # before that, it has not joined the air yet
        return delivered

    def _figures(self) -> dict[str, float]:
        with self._lock:
            return {DELIVERED: self._delivered, LOST_IN_RANGE: self._lost}


def _usual_topic(node_id: int) -> str:
    return rospy.resolve_name(names.node_topic(node_id))


def main() -> None:
    start_node(WirelessSignalSimulator.__doc__, "WirelessSignalSimulator")
    configuration = or_exit(
        lambda: factory_configuration("max_distance", "obstacles", "obstacle_radio")
    )
    obstacles = or_exit(lambda: configured_obstacles(configuration))
    show_library_logs_on_rosout()
    max_distance_m = configuration.max_distance
    if obstacles is not None and obstacles.boxes:
        verb = "block" if obstacles.blocks else "attenuate"
        _log.info("obstacles that %s the radio: %d", verb, len(obstacles.boxes))
    WirelessSignalSimulator(max_distance_m, obstacles)
    _log.info("nodes closer than %g m hear each other", max_distance_m)
    MasterWatch().start()
    rospy.spin()
