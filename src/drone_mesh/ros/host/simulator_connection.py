"""SimulatorConnection: the services of one WirelessSignalSimulator, called with raw bytes."""

from __future__ import annotations

import logging
import struct
from typing import Any, Sequence

from drone_mesh.communication.wire.messages import readdressed, receiver, sender
from drone_mesh.ros.graph import names
from drone_mesh.ros.graph.persistent_service import (
    PersistentService,
    Request,
    Response,
    ServiceClass,
    ServiceGone,
    ServiceUnknown,
)
from drone_mesh.srv import AreaScan, Broadcast, WirelessMessage, WirelessMessages

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
        """Close all connections."""
        for service in self._services:
            service.close()

    def send(self, payload: bytes) -> bool:
        """Hand over a packet for the node in its byte 3. True: that node received it."""
        # The fields of a WirelessMessageRequest and of its response are single bytes.
        fields = bytes((sender(payload), receiver(payload))) + payload
        return self._message.call_bytes(fields) != b"\0"

    def send_all(self, payloads: Sequence[bytes]) -> list[bool]:
        """Hand over at least one packet of one sender; returns for each whether it was received."""
        if self._messages is None:
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
