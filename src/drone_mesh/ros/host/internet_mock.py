"""RosInternetMock: a ROS topic in place of a gateway's internet."""

from __future__ import annotations

import logging

import rospy

from drone_mesh.communication.interfaces import IGatewayCommands, IInternetConnection
from drone_mesh.errors import GoalRefused
from drone_mesh.execution import ExecutorSlot
from drone_mesh.msg import FlightOrderAnswer, RequestGatewayDroneFlight
from drone_mesh.ros.graph import names
from drone_mesh.ros.graph.conversions import location_of

_QUEUE = 512  # answers that may wait for a slow DroneManager: two whole fleets

_log = logging.getLogger(__name__)


class RosInternetMock(IInternetConnection):
    """Subscribes /gateway (RequestGatewayDroneFlight), and passes each order to its gateway.

    Publishes /gateway/answers (FlightOrderAnswer): the outcome of each order.

    `connect` and `disconnect` are for the executor's worker, to which orders are submitted.
    """

    def __init__(self, node_id: int, slot: ExecutorSlot) -> None:
        """`node_id` is the gateway's."""
        self._node_id = node_id
        self._slot = slot
        self._subscriber: rospy.Subscriber | None = None
        self._answers: rospy.Publisher | None = None

    def connect(self, commands: IGatewayCommands) -> None:
        """Subscribe; orders go to `commands`."""

        def order(request: RequestGatewayDroneFlight) -> None:
            self._slot.submit(lambda now_s: self._order(commands, request, now_s))

        self.disconnect()
        self._answers = rospy.Publisher(
            names.GATEWAY_ANSWERS_TOPIC, FlightOrderAnswer, tcp_nodelay=True, queue_size=_QUEUE
        )
        self._subscriber = rospy.Subscriber(
            names.GATEWAY_TOPIC, RequestGatewayDroneFlight, order, tcp_nodelay=True
        )

    def disconnect(self) -> None:
        """Leave both topics. A second call changes nothing."""
        if self._subscriber is not None and self._answers is not None:
            self._subscriber.unregister()
            self._answers.unregister()
        self._subscriber = self._answers = None

    def _order(
        self, commands: IGatewayCommands, request: RequestGatewayDroneFlight, now_s: float
    ) -> None:
        if self._answers is None:
            return  # the gateway has ended
        goal = location_of(request)
        try:
            taken = commands.send_goal_request_to_drone(
                request.ID, request.latitude, request.longitude, request.height, now_s
            )
        except GoalRefused as error:
            _log.warning("gateway %d: order for drone %d: %s", self._node_id, request.ID, error)
            self._answer(request.ID, FlightOrderAnswer.REFUSED)
            return
        self._answer(request.ID, FlightOrderAnswer.SENT if taken else FlightOrderAnswer.NO_ROUTE)
        if taken:
            _log.info("gateway %d sent drone %d to %s", self._node_id, request.ID, goal.in_words())

    def _answer(self, drone: int, outcome: int) -> None:
        if self._answers is not None:
            self._answers.publish(FlightOrderAnswer(self._node_id, drone, outcome))
