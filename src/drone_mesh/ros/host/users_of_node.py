"""UsersOfNode: the messages of users to and from one node, as a service and a topic."""

from __future__ import annotations

import rospy

from drone_mesh.communication.data.transport import ReceivedMessage, Transport
from drone_mesh.errors import MessageRefused
from drone_mesh.msg import ReceivedData
from drone_mesh.ros.graph import names
from drone_mesh.ros.graph.conversions import ros_time
from drone_mesh.srv import SendData, SendDataRequest, SendDataResponse
from drone_mesh.users.desk import UsersDesk, check_wait

_QUEUE = 64  # messages that may wait for a slow subscriber


class UsersOfNode:
    """The ROS side of one node's data.

    Publishes: /Nodes/<id>/received (ReceivedData)
    Services:  /Nodes/<id>/send (SendData)

    Requests are handled in threads of rospy, which wait for the executor's worker; everything else
    is for that worker.
    """

    def __init__(self, desk: UsersDesk) -> None:
        self._desk = desk
        self._service: rospy.Service | None = None
        self._publisher: rospy.Publisher | None = None

    def start(self, transport: Transport) -> None:
        """Offer the service and the topic."""
        node_id = self._desk.node_id
        self._publisher = rospy.Publisher(
            names.received_topic(node_id), ReceivedData, queue_size=_QUEUE
        )
        transport.on_received(self._received)
        self._service = rospy.Service(names.send_service(node_id), SendData, self._send)

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
        try:
            check_wait(request.wait)
            sending = self._desk.send(request.to, request.payload, request.port, request.reliable)
            ticket = sending.ticket()
        except MessageRefused as error:
            return SendDataResponse(success=False, message=str(error))
        arrived = sending.wait(request.wait)
        words = sending.in_words(request.wait)
        return SendDataResponse(success=arrived, message=words, ticket=ticket.number)
