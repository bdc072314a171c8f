"""UsersOfNode: the messages of users to and from one node, as a service and a topic."""

from __future__ import annotations

import threading

import rospy

from drone_mesh.communication.data.ticket import Ticket, TicketState
from drone_mesh.communication.data.transport import ReceivedMessage, Transport
from drone_mesh.errors import MessageRefused
from drone_mesh.execution import Seat
from drone_mesh.msg import ReceivedData
from drone_mesh.ros.graph import names
from drone_mesh.ros.graph.conversions import ros_time
from drone_mesh.srv import SendData, SendDataRequest, SendDataResponse

_QUEUE = 64  # messages that may wait for a slow subscriber
_HANDOVER_S = 5.0  # our choice: a node takes a message within this wall time


class UsersOfNode:
    """The ROS side of one node's data.

    Publishes: /Nodes/<id>/received (ReceivedData)
    Services:  /Nodes/<id>/send (SendData)

    Requests are handled in threads of rospy, which wait for the executor's worker; everything else
    is for that worker.
    """

    def __init__(self, node_id: int, seat: Seat) -> None:
        self._node_id = node_id
        self._seat = seat
        self._transport: Transport | None = None
        self._service: rospy.Service | None = None
        self._publisher: rospy.Publisher | None = None

    def start(self, transport: Transport) -> None:
        """Offer the service and the topic."""
        self._transport = transport
        self._publisher = rospy.Publisher(
            names.received_topic(self._node_id), ReceivedData, queue_size=_QUEUE
        )
        transport.on_received(self._received)
        self._service = rospy.Service(names.send_service(self._node_id), SendData, self._send)

    def stop(self) -> None:
        """Withdraw both. A second call changes nothing."""
        if self._service is not None and self._publisher is not None:
            self._service.shutdown()
            self._publisher.unregister()
        self._service = self._publisher = None

    def _received(self, message: ReceivedMessage) -> None:
        if self._publisher is None or rospy.is_shutdown():
            return
        data = ReceivedData(
            sender=message.sender,
            port=message.port,
            to_all=message.to_all,
            reliable=message.reliable,
            payload=message.payload,
        )
        data.header.stamp = ros_time(message.received_s)
        self._publisher.publish(data)

    def _send(self, request: SendDataRequest) -> SendDataResponse:
        sending = _Sending(request)
        transport = self._transport
        assert transport is not None
        self._seat.submit(lambda now_s: sending.hand_in(transport, now_s))
        if not sending.handed_in.wait(_HANDOVER_S):
            return SendDataResponse(
                success=False, message=f"node {self._node_id} is too busy to take a message"
            )
        ticket = sending.ticket
        if ticket is None:
            return SendDataResponse(success=False, message=sending.why_not)
        if request.wait > 0:
            sending.ended.wait(request.wait)
        good = ticket.state is not TicketState.GIVEN_UP
        if request.wait > 0 and not ticket.final:
            good = False
        return SendDataResponse(success=good, message=str(ticket), ticket=ticket.number)


class _Sending:
    """One request, between a thread of rospy and the worker."""

    def __init__(self, request: SendDataRequest) -> None:
        self._request = request
        self.handed_in = threading.Event()  # then the fields below are set
        self.ended = threading.Event()
        self.ticket: Ticket | None = None
        self.why_not = ""

    def hand_in(self, transport: Transport, now_s: float) -> None:
        """On the worker's thread."""
        request = self._request
        try:
            ticket = transport.send(
                request.to, request.payload, now_s, port=request.port, reliable=request.reliable
            )
        except MessageRefused as error:
            self.why_not = str(error)
        else:
            ticket.changed = self._changed
            self._changed(ticket)
            self.ticket = ticket
        self.handed_in.set()

    def _changed(self, ticket: Ticket) -> None:
        if ticket.final:
            self.ended.set()
