"""RosInternetMock: a ROS topic in place of a gateway's internet."""

from __future__ import annotations

import logging
from contextlib import ExitStack
from functools import partial

import rospy

from drone_mesh.communication.interfaces import IGatewayCommands, IInternetConnection
from drone_mesh.errors import GoalRefused, PlaceTaken
from drone_mesh.execution import ExecutorSlot
from drone_mesh.msg import FlightOrderAnswer, RequestGatewayDroneFlight
from drone_mesh.ros.graph import names
from drone_mesh.ros.graph.conversions import location_of
from drone_mesh.ros.graph.logs import ThrottledLog
from drone_mesh.srv import PowerSwitch, PowerSwitchRequest, PowerSwitchResponse
from drone_mesh.web.access import Allowance

_QUEUE = 512  # answers that may wait for a slow DroneManager: two whole fleets

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
            names.GATEWAY_ANSWERS_TOPIC, FlightOrderAnswer, tcp_nodelay=True, queue_size=_QUEUE
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
            self._throttled_log.info(
                f"gateway {self._node_id}: order for drone {request.ID}", f"to {goal.in_words()}"
            )

    def _refuse(
        self, drone: int, why: str, outcome: int = FlightOrderAnswer.REFUSED, taken_by: int = 0
    ) -> None:
        self._throttled_log.warning(
            f"gateway {self._node_id}: order refused", f"for drone {drone}: {why}"
        )
        self._answer(drone, outcome, why, taken_by)

    def _answer(self, drone: int, outcome: int, reason: str = "", taken_by: int = 0) -> None:
        if self._answers is not None:
            self._answers.publish(
                FlightOrderAnswer(self._node_id, drone, outcome, reason, taken_by)
            )
