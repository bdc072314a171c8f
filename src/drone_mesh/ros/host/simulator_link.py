"""SimulatorLink: connects all antennas of a process to the WirelessSignalSimulator."""

from __future__ import annotations

import logging
import math
import struct
import threading
from typing import Any, Sequence

import rospy
from std_msgs.msg import Bool

from drone_mesh.communication.wire.messages import readdressed, receiver, sender
from drone_mesh.execution import MeshExecutor
from drone_mesh.msg import DroneInfo
from drone_mesh.ros.graph import names
from drone_mesh.ros.graph.logs import ThrottledLog
from drone_mesh.ros.graph.persistent_service import (
    PersistentService,
    Request,
    Response,
    ServiceClass,
    ServiceGone,
    ServiceRefused,
    ServiceUnknown,
)
from drone_mesh.ros.host.announcements import Announcements, PlaceOf, probe_of
from drone_mesh.ros.host.radios import Radios
from drone_mesh.srv import AreaScan, Broadcast, WirelessMessage, WirelessMessages

POLL_PERIOD_S = 0.1  # wall seconds between two attempts to reach a simulator
ANNOUNCE_AGAIN_AFTER = 20  # polls; an unregistered antenna is announced again
POLLS_PER_ROUND = 50  # each antenna is announced at least once in so many polls
_LENGTH = struct.Struct("<I")  # of an array, as ROS serialises it

_log = logging.getLogger(__name__)


class SimulatorConnection:
    """Hands packets to a simulator. Every call raises ServiceGone or ServiceRefused.

    A simulator needs only the services of the specification, `message` and `othersinRange`;
    `messages` and `broadcast` save calls if it offers them.

    For the executor's worker only, except `is_connected`, which any thread may call.
    """

    def __init__(self) -> None:
        """Connect. Raises ServiceGone."""
        self._services: list[PersistentService[Any, Any]] = []  # those that are open
        try:
            self._message = self._connect(names.MESSAGE_SERVICE, WirelessMessage)
            self._messages = self._if_offered(names.MESSAGES_SERVICE, WirelessMessages)
            self._broadcast = self._if_offered(names.BROADCAST_SERVICE, Broadcast)
            if self._broadcast is None:
                self._others = self._connect(names.OTHERS_IN_RANGE_SERVICE, AreaScan)
        except ServiceGone:
            self.close()
            raise
        self.simulator = self._message.server  # the name of its node; empty if unknown

    def is_connected(self) -> bool:
        """Whether all connections are still open at the other end."""
        return all(service.is_connected() for service in self._services)

    def close(self) -> None:
        for service in self._services:
            service.close()

    def send(self, payload: bytes) -> bool:
        """Hand over a packet for the node in its byte 3. True: that node received it."""
        # The fields of a WirelessMessageRequest and of its response are single bytes.
        fields = bytes((sender(payload), receiver(payload))) + payload
        return self._message.call_bytes(fields) != b"\0"

    def send_all(self, payloads: Sequence[bytes]) -> list[bool]:
        """Hand over packets of one sender; returns for each whether it was received."""
        if self._messages is None or len(payloads) < 2:
            return [self.send(payload) for payload in payloads]
        packets = b"".join(payloads)
        # The fields of a WirelessMessagesRequest.
        fields = bytes((sender(payloads[0]),)) + _LENGTH.pack(len(packets)) + packets
        answer = self._messages.call_bytes(fields)
        return [bool(taken) for taken in answer[_LENGTH.size :]]

    def broadcast(self, payload: bytes) -> int:
        """Hand over a packet for every node in range; returns how many received it."""
        asker = bytes((sender(payload),))
        if self._broadcast is not None:
            # The fields of a BroadcastRequest; the answer: an array of the nodes that received it.
            return len(self._broadcast.call_bytes(asker + payload)) - _LENGTH.size
        others = self._others.call_bytes(asker)[_LENGTH.size :]
        return sum(self.send(readdressed(payload, node_id)) for node_id in others)

    def _connect(
        self, name: str, service_class: ServiceClass[Request, Response]
    ) -> PersistentService[Request, Response]:
        service = PersistentService(name, service_class)
        service.connect()
        self._services.append(service)
        return service

    def _if_offered(
        self, name: str, service_class: ServiceClass[Request, Response]
    ) -> PersistentService[Request, Response] | None:
        try:
            return self._connect(name, service_class)
        except ServiceUnknown as error:
            _log.info("the simulator does not offer %s, using single messages: %s", name, error)
            return None


class SimulatorLink(Radios, rospy.SubscribeListener):
    """Finds a simulator, announces the antennas to it, and hands packets over.

    Publishes: /WirelessSignalSimulator (DroneInfo)
    Subscribes: /jammer (Bool: whether all its antennas measure the power of a jammer)
    Calls:     /SignalSimulator/message, messages, broadcast, othersinRange

    Three threads meet here. The executor's worker sends. The link's own thread connects, which can
    take long; sends fail at once during that time. rospy's threads report new subscribers.
    `_connection` is replaced as a whole, under `_lock`.
    """

    def __init__(self, executor: MeshExecutor, place_of: PlaceOf) -> None:
        self.executor = executor
        self._connection: SimulatorConnection | None = None
        self._lock = threading.Lock()
        self._throttled_log = ThrottledLog(_log)
        self._wake = threading.Event()
        self._stopping = False
        self.never_handed_over = 0  # this and the next: written by the executor's worker
        self.under_way = 0  # the sum over all processes is what is in transit or in a queue
        self._simulator = ""  # name of the latest one; written by the link's own thread
        self._probing = False  # the worker was asked to probe and has not done so yet
        self._publisher = rospy.Publisher(
            names.SIGNAL_TOPIC,
            DroneInfo,
            subscriber_listener=self,
            tcp_nodelay=True,
            queue_size=names.SIGNAL_QUEUE,
        )
        self.antennas = Announcements(self._publisher.publish, place_of)
        self.jammed = False  # written by a thread of rospy
        rospy.Subscriber(names.JAMMER_TOPIC, Bool, self._jam)
        self._thread = threading.Thread(target=self._keep_connected, name="simulator_link")

    def _jam(self, on: Bool) -> None:
        self.jammed = on.data

    def start(self) -> None:
        self._thread.start()

    def fall_silent(self) -> None:
        """Stop looking for a simulator; returns when the thread has ended."""
        self._stopping = True
        self._wake.set()
        if self._thread.is_alive():
            self._thread.join()

    def packet_processed(self, sender: str = "") -> None:
        """A node of this process has processed a packet of this ROS node. On the worker.

        Packets that other ROS nodes than the simulator send are not counted.
        """
        if not (sender and self._simulator) or sender == self._simulator:
            self.under_way -= 1

    @property
    def ready(self) -> bool:
        return self._connection is not None

    # Packets, the executor's worker ----------------------------------------------------------

    def send(self, payload: bytes) -> bool:
        """Hand over a packet for the node in its byte 3. True: that node received it."""
        return self.send_all((payload,))[0]

    def send_all(self, payloads: Sequence[bytes]) -> list[bool]:
        """Hand over packets of one sender; returns for each whether it was received."""
        connection = self._connection
        try:
            if connection is not None:
                taken = connection.send_all(payloads)
                self.under_way += sum(taken)
                return taken
            self._without_simulator(len(payloads))
        except ServiceRefused as error:
            self._throttled_log.note("packet refused", str(error))
        except ServiceGone as error:
            self._without_simulator(len(payloads), connection, error)
        return [False] * len(payloads)

    def broadcast(self, payload: bytes) -> None:
        """Hand over a packet for every node in range of the sender in its byte 1."""
        connection = self._connection
        try:
            if connection is not None:
                self.under_way += connection.broadcast(payload)
            else:
                self._without_simulator(1)
        except ServiceRefused as error:  # a new simulator, to which it will soon be announced
            _log.debug("broadcast refused: %s", error)
        except ServiceGone as error:
            self._without_simulator(1, connection, error)

    def _without_simulator(
        self,
        packets: int,
        connection: SimulatorConnection | None = None,
        error: ServiceGone | None = None,
    ) -> None:
        """So many packets were not handed over, because of the error of this connection."""
        self.never_handed_over += packets
        if connection is not None and error is not None:
            self._lost(connection, error)
        elif packets:
            self._throttled_log.note("packet not sent", "no simulator", logging.ERROR)

    def _probe(self, _now_s: float) -> None:
        """Send the probe of each antenna that the simulator may not have registered yet."""
        self._probing = False
        connection = self._connection
        if connection is None:
            return
        for antenna in self.antennas.unregistered():
            if antenna.on():
                try:
                    connection.send(probe_of(antenna.node_id))
                except (ServiceGone, ServiceRefused) as error:
                    _log.debug("probe of node %d: %s", antenna.node_id, error)
                    return

    # Connecting, the link's own thread -------------------------------------------------------

    def _keep_connected(self) -> None:
        polls = 0
        while not self._stopping and not rospy.is_shutdown():
            self._wake.wait(POLL_PERIOD_S)
            self._wake.clear()
            connection = self._connection
            if connection is not None and not connection.is_connected():
                self._lost(connection, ServiceGone("it closed its connections"))
            if self._connection is None:
                self._try_to_connect()
            if self._connection is not None:
                self.antennas.announce_next(math.ceil(len(self.antennas) / POLLS_PER_ROUND))
            if self._connection is not None and self.antennas.unregistered():
                polls += 1
                if polls % ANNOUNCE_AGAIN_AFTER == 0:
                    self.antennas.announce_unregistered()
                if not self._probing:
                    self._probing = True
                    self.executor.submit(self._probe)

    def _try_to_connect(self) -> None:
        if self._publisher.get_num_connections() == 0:
            return
        try:
            connection = SimulatorConnection()
        except ServiceGone as error:
            _log.debug("no simulator yet: %s", error)
            return
        self._simulator = connection.simulator
        with self._lock:
            self._connection = connection
        self.antennas.announce_all_to_new_simulator()
        _log.info("connected to the simulator; announced %d antennas", len(self.antennas))

    def _lost(self, connection: SimulatorConnection, error: ServiceGone) -> None:
        if rospy.is_shutdown():
            return
        with self._lock:
            if self._connection is not connection:
                return
            self._connection = None
        self.executor.submit(lambda _now_s: connection.close())  # not during a call of the worker
        _log.error("lost the simulator: %s", error)
        self._wake.set()

    # A thread of rospy -----------------------------------------------------------------------

    def peer_subscribe(self, _topic: str, _publish: object, _peer_publish: object) -> None:
        """A new subscriber, perhaps a new simulator. rospy waits: only wake the thread."""
        self._wake.set()
