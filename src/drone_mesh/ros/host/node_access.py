"""What programs in ROS exchange with one node: users' messages, and orders with a gateway."""

from __future__ import annotations

import logging
from contextlib import ExitStack
from functools import partial

import rospy

from drone_mesh.communication.data.transport import ReceivedMessage, Transport
from drone_mesh.communication.interfaces import IGatewayCommands, IInternetConnection
from drone_mesh.errors import GoalRefused, MessageRefused, PlaceTaken
from drone_mesh.execution import ExecutorSlot
from drone_mesh.msg import FlightOrderAnswer, ReceivedData, RequestGatewayDroneFlight
from drone_mesh.ros.graph import names
from drone_mesh.ros.graph.conversions import location_of, ros_time
from drone_mesh.ros.graph.logs import ThrottledLog
from drone_mesh.srv import (
    PowerSwitch,
    PowerSwitchRequest,
    PowerSwitchResponse,
    SendData,
    SendDataRequest,
    SendDataResponse,
)
from drone_mesh.users.desk import UsersDesk, check_wait
from drone_mesh.web.access import Allowance

_ANSWERS_QUEUE = 512  # answers that may wait for a slow DroneManager: two whole fleets
_MESSAGES_QUEUE = 64  # that may wait for a slow subscriber
MOST_ORDERS_AT_ONCE = 512  # two whole fleets
ORDER_PERIOD_S = 0.05  # wall: of further orders

_log = logging.getLogger(__name__)


class RosInternetMock(IInternetConnection):
    """Passes orders to its gateway.

    Subscribes: /gateway (RequestGatewayDroneFlight), and /gateway/shared_place (the same type) for
    orders that may lead to the place of another drone.
    Publishes /gateway/answers (FlightOrderAnswer): the outcome of each order.
    Service: /Nodes/<id>/internetSwitch (PowerSwitch): whether its internet works.

    `connect` and `disconnect` are for the executor's worker, which gets the orders as requests.
    """

    def __init__(self, node_id: int, slot: ExecutorSlot) -> None:
        """`node_id` is the gateway's."""
        self._node_id = node_id
        self._slot = slot
        self._open = ExitStack()  # what `disconnect` closes
        self._answers: rospy.Publisher | None = None
        self._limit = Allowance(MOST_ORDERS_AT_ONCE, ORDER_PERIOD_S)
        self._throttled_log = ThrottledLog(_log)

    def connect(self, commands: IGatewayCommands) -> None:
        """Subscribe; orders go to `commands`."""

        def order(allow_shared_place: bool, request: RequestGatewayDroneFlight) -> None:
            if self._limit.is_over():
                self._refuse(request.ID, f"more than {1 / ORDER_PERIOD_S:g} orders a second")
                return
            self._limit.note()
            self._slot.request(
                lambda now_s: self._order(commands, request, allow_shared_place, now_s)
            )

        def switch(request: PowerSwitchRequest) -> PowerSwitchResponse:
            self._slot.submit(lambda now_s: commands.set_internet(request.power, now_s))
            return PowerSwitchResponse()

        self.disconnect()
        service = rospy.Service(names.internet_switch(self._node_id), PowerSwitch, switch)
        self._open.callback(service.shutdown)
        self._answers = rospy.Publisher(
            names.GATEWAY_ANSWERS_TOPIC,
            FlightOrderAnswer,
            tcp_nodelay=True,
            queue_size=_ANSWERS_QUEUE,
        )
        self._open.callback(self._answers.unregister)
        for topic, shared in ((names.GATEWAY_TOPIC, False), (names.SHARED_PLACE_TOPIC, True)):
            subscriber = rospy.Subscriber(
                topic, RequestGatewayDroneFlight, partial(order, shared), tcp_nodelay=True
            )
            self._open.callback(subscriber.unregister)

    def disconnect(self) -> None:
        """Leave the topics. A second call changes nothing."""
        self._open.close()
        self._answers = None

    def _order(
        self,
        commands: IGatewayCommands,
        request: RequestGatewayDroneFlight,
        allow_shared_place: bool,
        now_s: float,
    ) -> None:
        if self._answers is None:
            return  # the gateway has ended
        goal = location_of(request)
        try:
            taken = commands.send_goal_request_to_drone(
                request.ID,
                request.latitude,
                request.longitude,
                request.height,
                now_s,
                allow_shared_place,
            )
        except PlaceTaken as error:
            self._refuse(request.ID, str(error), FlightOrderAnswer.PLACE_TAKEN, error.drone)
            return
        except GoalRefused as error:
            self._refuse(request.ID, str(error))
            return
        self._answer(request.ID, FlightOrderAnswer.SENT if taken else FlightOrderAnswer.NO_ROUTE)
        if taken:
            reason = f"gateway {self._node_id}: order for drone {request.ID}"
            self._throttled_log.note(reason, f"to {goal.in_words()}", logging.INFO)

    def _refuse(
        self, drone: int, why: str, outcome: int = FlightOrderAnswer.REFUSED, taken_by: int = 0
    ) -> None:
        self._throttled_log.note(
            f"gateway {self._node_id}: order refused", f"for drone {drone}: {why}"
        )
        self._answer(drone, outcome, why, taken_by)

    def _answer(self, drone: int, outcome: int, reason: str = "", taken_by: int = 0) -> None:
        if self._answers is not None:
            self._answers.publish(
                FlightOrderAnswer(self._node_id, drone, outcome, reason, taken_by)
            )


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
            names.received_topic(node_id), ReceivedData, queue_size=_MESSAGES_QUEUE
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
