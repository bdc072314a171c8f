"""DroneManager: orders to drones, through the gateways (docs/ros.md, "Drone manager")."""

from __future__ import annotations

import logging
import time
from typing import Sequence

import actionlib
import rospy

from drone_mesh.communication.interfaces import MAX_NODE_ID
from drone_mesh.drone.fleet import ids_in_words
from drone_mesh.drone.goal import check_goal
from drone_mesh.errors import GoalRefused
from drone_mesh.layouts import Layouts, Order, UnknownCase
from drone_mesh.msg import RequestGatewayDroneFlight
from drone_mesh.ros.graph import names
from drone_mesh.ros.graph.command_line import start_node
from drone_mesh.ros.graph.conversions import flight_order, location_of
from drone_mesh.ros.graph.fleet_parameter import drones_if_known
from drone_mesh.ros.graph.logs import show_library_logs_on_rosout
from drone_mesh.ros.graph.master_watch import MasterWatch
from drone_mesh.ros.graph.parameters import manager_layouts, or_exit
from drone_mesh.ros.graph.present_drones import PresentDrones
from drone_mesh.ros.services.order_answers import OrderAnswers
from drone_mesh.ros.services.order_summary import OrderSummary
from drone_mesh.ros.services.standing_layouts import StandingLayouts
from drone_mesh.srv import (
    Casus,
    CasusRequest,
    CasusResponse,
    OrderLayout,
    OrderLayoutRequest,
    OrderLayoutResponse,
    RequestDroneFlight,
    RequestDroneFlightRequest,
    RequestDroneFlightResponse,
    WithdrawLayout,
    WithdrawLayoutRequest,
    WithdrawLayoutResponse,
)

WAIT_FOR_GATEWAY_S = 3.0  # of wall time (docs/ros.md, "Drone manager")
ANSWERS_TIMEOUT_S = 1.0  # our choice, wall: a gateway answers in milliseconds, if it answers
POLL_PERIOD_S = 0.05
ORDERS_IN_QUEUE = 512  # two whole fleets

_log = logging.getLogger(__name__)


class DroneManager:
    """Passes orders from users and layouts to the gateways.

    Parameters (private): ~casus (a YAML file of layouts; config/casus.yaml by default)
    Publishes:  /gateway (RequestGatewayDroneFlight)
    Subscribes: /gateway/answers (FlightOrderAnswer)
    Services:   /DroneManager/requestDroneMovement (RequestDroneFlight), /DroneManager/SetToCasus
                (Casus), also as /requestDroneMovement and /SetToCasus;
                /DroneManager/orderLayout (OrderLayout), /DroneManager/withdrawLayout
                (WithdrawLayout)
    Standing orders: see StandingLayouts
    """

    # The handlers may run in parallel: the layouts never change, StandingLayouts has its own lock.

    def __init__(self, layouts: Layouts) -> None:
        self._layouts = layouts
        self._gateways = rospy.Publisher(
            names.GATEWAY_TOPIC,
            RequestGatewayDroneFlight,
            tcp_nodelay=True,
            queue_size=ORDERS_IN_QUEUE,
        )
        self._answers = OrderAnswers()
        self._standing = StandingLayouts(self._publish, self._carry_out)
        for name in (names.REQUEST_MOVEMENT_SERVICE, names.SHORT_REQUEST_MOVEMENT_SERVICE):
            rospy.Service(name, RequestDroneFlight, self._request_movement)
        for name in (names.SET_TO_CASUS_SERVICE, names.SHORT_SET_TO_CASUS_SERVICE):
            rospy.Service(name, Casus, self._set_to_casus)
        rospy.Service(names.ORDER_LAYOUT_SERVICE, OrderLayout, self._order_layout)
        rospy.Service(names.WITHDRAW_LAYOUT_SERVICE, WithdrawLayout, self._withdraw_layout)

    def _request_movement(self, request: RequestDroneFlightRequest) -> RequestDroneFlightResponse:
        """Status 1: a gateway has the order; 2: no gateway has a route; 0: there is no gateway."""
        goal = location_of(request)
        try:
            check_goal(*goal)
        except GoalRefused as error:
            raise rospy.ServiceException(str(error)) from None
        if request.ID > MAX_NODE_ID:
            raise rospy.ServiceException(f"invalid drone id {request.ID}: must be 0..{MAX_NODE_ID}")
        fleet = drones_if_known()
        if fleet is not None and request.ID not in fleet.roles:
            raise rospy.ServiceException(
                f"drone {request.ID} is not in this fleet: its ids are {ids_in_words(fleet.roles)}"
            )
        if not self._gateway_is_there():
            _log.warning("drone %d: order dropped: no gateway is running", request.ID)
            return RequestDroneFlightResponse(status=0)
        _sent, no_route = self._order([Order(request.ID, goal)], fleet)
        if no_route:
            _log.warning("drone %d: no gateway has a route to it", request.ID)
        else:
            self._standing.replace(request.ID)
        return RequestDroneFlightResponse(status=2 if no_route else 1)

    def _set_to_casus(self, request: CasusRequest) -> CasusResponse:
        self._carry_out(request.caseID)
        return CasusResponse()

    def _order_layout(self, request: OrderLayoutRequest) -> OrderLayoutResponse:
        number, summary = self._carry_out(request.caseID)
        return OrderLayoutResponse(
            number, summary.sent, summary.no_route, summary.not_in_fleet, summary.in_words()
        )

    def _withdraw_layout(self, request: WithdrawLayoutRequest) -> WithdrawLayoutResponse:
        words = self._standing.withdraw(request.id)
        if words is None:
            return WithdrawLayoutResponse(False, f"there is no standing order {request.id}")
        return WithdrawLayoutResponse(True, words)

    def _carry_out(
        self, case: int, handle: actionlib.ServerGoalHandle | None = None
    ) -> tuple[int, OrderSummary]:
        """Order a layout; returns the number of its standing order, and its first outcome."""
        try:
            orders = self._layouts.orders(case)
        except UnknownCase as error:
            raise rospy.ServiceException(str(error)) from None
        if not self._gateway_is_there():
            raise rospy.ServiceException("no gateway is running")
        fleet = drones_if_known()
        known = [o for o in orders if fleet is None or o.node_id in fleet.roles]
        missing = [order.node_id for order in orders if order not in known]
        number = self._standing.give(case, orders, handle)
        sent, no_route = self._order(known, fleet)
        summary = OrderSummary(sent, no_route, missing)
        complete = len(sent) == len(orders)
        _log.log(
            logging.INFO if complete else logging.WARNING, "case %d: %s", case, summary.in_words()
        )
        return number, summary

    def _publish(self, orders: Sequence[Order]) -> None:
        for node_id, goal in orders:
            self._gateways.publish(flight_order(node_id, goal))

    def _order(
        self, orders: Sequence[Order], fleet: PresentDrones | None
    ) -> tuple[list[int], list[int]]:
        """Publish these orders in sequence; returns the ids (sent, without a route)."""

        gateways = self._gateways.get_num_connections() if fleet is None else len(fleet.gateways)
        drones = [order.node_id for order in orders]
        return self._answers.await_outcomes(
            drones, lambda: self._publish(orders), gateways, ANSWERS_TIMEOUT_S
        )

    def _gateway_is_there(self) -> bool:
        """Whether a gateway subscribes; waits for one, which may be starting."""
        deadline_s = time.monotonic() + WAIT_FOR_GATEWAY_S
        while not rospy.is_shutdown():
            if self._gateways.impl is not None:
                self._gateways.impl.check()  # drops what a killed gateway left behind
            if self._gateways.get_num_connections() > 0:
                return True
            if time.monotonic() >= deadline_s:
                return False
            time.sleep(POLL_PERIOD_S)
        return False


def main() -> None:
    """Run the node."""
    start_node(DroneManager.__doc__, "DroneManager")
    show_library_logs_on_rosout()
    layouts = or_exit(lambda: manager_layouts("~casus"))
    DroneManager(layouts)
    file = rospy.get_param("~casus", "") or "config/casus.yaml of this package"
    _log.info("%d layouts: built-in ones, and those of %s", len(layouts.cases), file)
    MasterWatch().start()
    rospy.spin()
