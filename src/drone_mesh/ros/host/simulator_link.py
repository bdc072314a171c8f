"""SimulatorLink: the way of all antennas of one process to the WirelessSignalSimulator."""

from __future__ import annotations

import logging
import struct
import threading
from typing import Callable, NamedTuple, Protocol, Sequence

import rospy

from drone_mesh.communication.messages import MessageType, packet, receiver, sender
from drone_mesh.execution import MeshExecutor
from drone_mesh.msg import DroneInfo
from drone_mesh.ros.graph import names
from drone_mesh.ros.graph.logs import ThrottledLog
from drone_mesh.ros.graph.persistent_service import PersistentService, ServiceGone, ServiceRefused
from drone_mesh.srv import Broadcast, WirelessMessage, WirelessMessages

LOOK_PERIOD_S = 0.1  # our choice: wall seconds between two attempts to reach a simulator
ANNOUNCE_AGAIN_AFTER = 20  # looks; our choice: an antenna not yet registered speaks up again
_NO_PLACE = (0.0, 0.0, 0.0)  # an antenna sends no position (docs/protocol.md, "Virtual antenna")

_LENGTH = struct.Struct("<I")  # of an array, as ROS serialises it

_log = logging.getLogger(__name__)


class Antenna(Protocol):
    """What the link has to know of an antenna."""

    node_id: int

    def on(self) -> bool:
        """Whether it has power."""


class _Services(NamedTuple):
    """Connections to one simulator."""

    message: PersistentService
    messages: PersistentService
    broadcast: PersistentService

    def close(self) -> None:
        for service in self:
            service.close()


def probe_of(node_id: int) -> bytes:
    """The packet that an antenna sends to itself, to see whether a simulator knows it."""
    return packet(MessageType.NOTDEFINED, node_id, node_id, node_id, node_id)


def _hand_over(services: _Services, payload: bytes) -> bool:
    """Call `message`: the fields of its request and response, which are bytes all of them."""
    fields = bytes((sender(payload), receiver(payload))) + payload
    return services.message.call_bytes(fields) != b"\0"


class SimulatorLink(rospy.SubscribeListener):
    """Shared by all antennas of a process. Publishes /WirelessSignalSimulator (DroneInfo).

    Three threads meet here. The executor's worker sends. The link's own thread connects, for that
    may take long: while nobody is there, a send fails at once. Threads of rospy tell of new
    subscribers. `_services` is replaced as a whole; `_lock` guards that, the antennas, and which of
    them the simulator does not have yet. It is not held while something is sent.
    """

    def __init__(self, executor: MeshExecutor) -> None:
        self._executor = executor
        self._services: _Services | None = None
        self._lock = threading.Lock()
        self._antennas: dict[int, Antenna] = {}
        self._on_registered: dict[int, Callable[[], None]] = {}
        self._unregistered: set[int] = set()
        self._complaints = ThrottledLog(_log)
        self._look = threading.Event()
        self._stopping = False
        self._never_handed_over = 0  # written by the executor's worker
        self._probing = False  # the worker has been asked to probe, and has not done it yet
        self._publisher = rospy.Publisher(
            names.SIGNAL_TOPIC,
            DroneInfo,
            subscriber_listener=self,
            tcp_nodelay=True,
            queue_size=names.SIGNAL_QUEUE,
        )
        self._thread = threading.Thread(target=self._keep_connected, name="simulator_link")

    def start(self) -> None:
        """Look for a simulator from now on."""
        self._thread.start()

    def stop(self) -> None:
        """Stop looking; returns when the thread has ended."""
        self._stopping = True
        self._look.set()
        if self._thread.is_alive():
            self._thread.join()

    @property
    def never_handed_over(self) -> int:
        """Packets, since the start, that no simulator took."""
        return self._never_handed_over

    @property
    def connected(self) -> bool:
        """Whether packets can be handed to a simulator."""
        return self._services is not None

    # Antennas, any thread --------------------------------------------------------------------

    def add(self, antenna: Antenna, on_registered: Callable[[], None]) -> None:
        """Announce this antenna to each simulator; `on_registered` each time one knows it.

        That is: when the antenna's own packet came back from there. Called by any thread.
        """
        with self._lock:
            self._antennas[antenna.node_id] = antenna
            self._on_registered[antenna.node_id] = on_registered
            self._unregistered.add(antenna.node_id)
        self.announce(antenna)

    def remove(self, antenna: Antenna) -> None:
        """Forget this antenna. Not known: nothing changes."""
        with self._lock:
            self._antennas.pop(antenna.node_id, None)
            self._on_registered.pop(antenna.node_id, None)
            self._unregistered.discard(antenna.node_id)

    def announce(self, antenna: Antenna) -> None:
        """Tell the simulator where this antenna listens, and whether it has power."""
        topic = names.node_topic(antenna.node_id)
        self._publisher.publish(DroneInfo(antenna.node_id, _NO_PLACE, topic, antenna.on()))

    def probe_returned(self, node_id: int) -> None:
        """An antenna received its own probe: the simulator knows it. Again: nothing changes."""
        with self._lock:
            if node_id not in self._unregistered:
                return
            self._unregistered.discard(node_id)
            on_registered = self._on_registered[node_id]
        on_registered()

    # Packets, the executor's worker ----------------------------------------------------------

    def send(self, payload: bytes) -> bool:
        """Hand a packet to the node in its byte 3; True: it has it."""
        services = self._services
        if services is None:
            self._complaints.error("packet not sent", "no simulator")
            self._never_handed_over += 1
            return False
        try:
            return _hand_over(services, payload)
        except ServiceRefused as error:
            self._complaints.warning("packet refused", str(error))
        except ServiceGone as error:
            self._never_handed_over += 1
            self._lost(services, error)
        return False

    def send_all(self, payloads: Sequence[bytes]) -> list[bool]:
        """Hand packets of one node to the nodes in their byte 3; for each whether that has it."""
        services = self._services
        if services is None or not payloads:
            return [self.send(payload) for payload in payloads]
        packets = b"".join(payloads)
        # The fields of a WirelessMessagesRequest.
        fields = bytes((sender(payloads[0]),)) + _LENGTH.pack(len(packets)) + packets
        try:
            answer = services.messages.call_bytes(fields)
        except ServiceRefused as error:
            self._complaints.warning("packets refused", str(error))
        except ServiceGone as error:
            self._never_handed_over += len(payloads)
            self._lost(services, error)
        else:
            return [bool(taken) for taken in answer[_LENGTH.size :]]
        return [False] * len(payloads)

    def broadcast(self, payload: bytes) -> None:
        """Hand a packet to everybody in range of the node in its byte 1."""
        services = self._services
        if services is None:
            self._complaints.error("packet not sent", "no simulator")
            self._never_handed_over += 1
            return
        try:
            # The fields of a BroadcastRequest.
            services.broadcast.call_bytes(bytes((sender(payload),)) + payload)
        except ServiceRefused:
            # The simulator is new, and will hear of this antenna in a moment: no line in the log.
            self._complaints.counts["broadcast refused"] += 1
        except ServiceGone as error:
            self._never_handed_over += 1
            self._lost(services, error)

    def _lost(self, services: _Services, error: ServiceGone) -> None:
        if rospy.is_shutdown():
            return
        with self._lock:
            if self._services is not services:
                return
            self._services = None
        self._executor.submit(lambda _now_s: services.close())  # not while the worker is in a call
        _log.error("the simulator is gone: %s", error)
        self._look.set()

    def _probe(self, _now_s: float) -> None:
        """Let each antenna that the simulator may not have yet send a packet to itself."""
        self._probing = False
        services = self._services
        if services is None:
            return
        with self._lock:
            antennas = [self._antennas[node_id] for node_id in self._unregistered]
        for antenna in antennas:
            if antenna.on():
                try:
                    _hand_over(services, probe_of(antenna.node_id))
                except (ServiceGone, ServiceRefused) as error:
                    _log.debug("probe of node %d: %s", antenna.node_id, error)
                    return

    # Connecting, the link's own thread -------------------------------------------------------

    def _keep_connected(self) -> None:
        looks = 0
        while not self._stopping and not rospy.is_shutdown():
            self._look.wait(LOOK_PERIOD_S)
            self._look.clear()
            services = self._services
            if services is not None and not all(service.is_connected() for service in services):
                self._lost(services, ServiceGone("it closed its connections"))
            if self._services is None:
                self._try_to_connect()
            if self._services is not None and self._unregistered:
                looks += 1
                if looks % ANNOUNCE_AGAIN_AFTER == 0:
                    self._announce(unregistered_only=True)
                if not self._probing:
                    self._probing = True
                    self._executor.submit(self._probe)

    def _try_to_connect(self) -> None:
        if self._publisher.get_num_connections() == 0:
            return
        services = _Services(
            PersistentService(names.MESSAGE_SERVICE, WirelessMessage),
            PersistentService(names.MESSAGES_SERVICE, WirelessMessages),
            PersistentService(names.BROADCAST_SERVICE, Broadcast),
        )
        try:
            for service in services:
                service.connect()
        except ServiceGone as error:
            _log.debug("no simulator yet: %s", error)
            return
        with self._lock:
            self._unregistered.update(self._on_registered)
            self._services = services
        self._announce(unregistered_only=False)
        _log.info("connected to the simulator; %d antennas announced", len(self._antennas))

    def _announce(self, unregistered_only: bool) -> None:
        with self._lock:
            node_ids = self._unregistered if unregistered_only else self._antennas
            antennas = [self._antennas[node_id] for node_id in node_ids]
        for antenna in antennas:
            self.announce(antenna)

    def peer_subscribe(self, _topic: str, _publish: object, _peer_publish: object) -> None:
        """Somebody subscribed, perhaps a new simulator (rospy's thread: must not take long)."""
        self._look.set()
