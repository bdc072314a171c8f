"""DroneManager: orders to drones, through the gateways (docs/ros.md, "Drone manager")."""

from __future__ import annotations

import contextlib
import functools
import logging
from typing import Callable, Iterator, Sequence

import actionlib
import rospy

from drone_mesh import srv
from drone_mesh.communication.interfaces import MAX_NODE_ID
from drone_mesh.drone.fleet import ids_in_words
from drone_mesh.drone.goal import check_apart, check_goal
from drone_mesh.errors import GoalRefused
from drone_mesh.formations.layouts import MAX_NAME, Layouts, Order, UnknownCase
from drone_mesh.formations.standing_order import PartState
from drone_mesh.msg import FlightOrderAnswer, RequestGatewayDroneFlight
from drone_mesh.ros.graph import names
from drone_mesh.ros.graph.command_line import start_node
from drone_mesh.ros.graph.conversions import location_of
from drone_mesh.ros.graph.fleet_parameter import drones_if_known
from drone_mesh.ros.graph.logs import show_library_logs_on_rosout
from drone_mesh.ros.graph.master import MasterWatch
from drone_mesh.ros.graph.orderly_stop import OrderlyStop
from drone_mesh.ros.graph.parameters import manager_layouts, or_exit
from drone_mesh.ros.graph.simulation import PresentDrones
from drone_mesh.ros.graph.waiting import comes_true
from drone_mesh.ros.services.fence_service import FenceService
from drone_mesh.ros.services.order_answers import OrderAnswers, Outcomes
from drone_mesh.ros.services.order_summary import OrderSummary
from drone_mesh.ros.services.standing_layouts import LayoutStart, StandingLayouts, flight_rules

WAIT_FOR_GATEWAY_S = 3.0  # of wall time (docs/ros.md, "Drone manager")
ANSWERS_TIMEOUT_S = 1.0  # wall: a gateway answers in milliseconds, if it answers
NO_GATEWAY = "no gateway is running to take the order"
ORDERS_IN_QUEUE = 512  # two whole fleets

_log = logging.getLogger(__name__)


class DroneManager:
    """Passes orders from users and layouts to the gateways.

    Parameters (private): ~casus (a YAML file of layouts; config/casus.yaml by default)
    Publishes:  /gateway, /gateway/shared_place (RequestGatewayDroneFlight)
    Subscribes: /gateway/answers (FlightOrderAnswer)
    Services:   /DroneManager/requestDroneMovement (RequestDroneFlight), /DroneManager/SetToCasus
                (Casus), also as /requestDroneMovement and /SetToCasus;
                /DroneManager/orderFlight (OrderFlight), /DroneManager/orderLayout (OrderLayout),
                /DroneManager/orderFormation (OrderFormation), /DroneManager/previewLayout
                (PreviewLayout), /DroneManager/withdrawLayout (WithdrawLayout)
    Standing orders: see StandingLayouts; the fence: see FenceService
    """

    # The handlers may run in parallel: the layouts never change, StandingLayouts has its own lock.

    def __init__(
        self, layouts: Layouts, on_other_run: Callable[[], None], watch: MasterWatch
    ) -> None:
        """`on_other_run` is called, by a thread of rospy, when the world was replaced."""
        self._layouts = layouts
        self._gateways, self._sharing = (
            rospy.Publisher(
                topic, RequestGatewayDroneFlight, tcp_nodelay=True, queue_size=ORDERS_IN_QUEUE
            )
            for topic in (names.GATEWAY_TOPIC, names.SHARED_PLACE_TOPIC)
        )
        self._answers = OrderAnswers()
        self._standing = StandingLayouts(
            functools.partial(self._publish, allow_shared_place=True),
            self._order_case,
            on_other_run,
            watch,
        )
        FenceService()
        for name in (names.REQUEST_MOVEMENT_SERVICE, names.SHORT_REQUEST_MOVEMENT_SERVICE):
            rospy.Service(name, srv.RequestDroneFlight, self._request_movement)
        for name in (names.SET_TO_CASUS_SERVICE, names.SHORT_SET_TO_CASUS_SERVICE):
            rospy.Service(name, srv.Casus, self._set_to_casus)
        rospy.Service(names.ORDER_FLIGHT_SERVICE, srv.OrderFlight, self._order_flight)
        rospy.Service(names.ORDER_LAYOUT_SERVICE, srv.OrderLayout, self._order_layout)
        rospy.Service(names.ORDER_FORMATION_SERVICE, srv.OrderFormation, self._order_formation)
        rospy.Service(names.PREVIEW_LAYOUT_SERVICE, srv.PreviewLayout, self._preview_layout)
        rospy.Service(names.WITHDRAW_LAYOUT_SERVICE, srv.WithdrawLayout, self._withdraw_layout)

    def _request_movement(
        self, request: srv.RequestDroneFlightRequest
    ) -> srv.RequestDroneFlightResponse:
        """Status 1: a gateway has the order; 2: no gateway has a route; 0: there is no gateway."""
        why_not, _warning = self._order_one(Order(request.ID, location_of(request)), False)
        return srv.RequestDroneFlightResponse({"": 1, NO_GATEWAY: 0}.get(why_not, 2))

    def _order_flight(self, request: srv.OrderFlightRequest) -> srv.OrderFlightResponse:
        order = Order(request.id, location_of(request))
        why_not, warning = self._order_one(order, request.allow_shared_place)
        return srv.OrderFlightResponse(success=not why_not, message=why_not or warning)

    def _order_one(self, order: Order, allow_shared_place: bool) -> tuple[str, str]:
        """Why no gateway sends it, else empty; and who loses the mesh by it, in words.

        Raises ServiceException: the order was refused.
        """
        drone, _goal = order
        _check(order)
        fleet = drones_if_known()
        if fleet is not None and drone not in fleet.roles:
            raise rospy.ServiceException(
                f"drone {drone} is not in this fleet: its ids are {ids_in_words(fleet.roles)}"
            )
        if not self._gateway_is_there():
            _log.warning("drone %d: order dropped: no gateway is running", drone)
            return NO_GATEWAY, ""
        warning = self._standing.lost_routes([order]).in_words()
        outcomes = self._order([order], fleet, allow_shared_place)
        for answer in outcomes.refused.values():
            raise rospy.ServiceException(answer.reason)
        if not outcomes.no_route:
            self._standing.ordered(order)
            if warning:
                _log.warning("drone %d ordered to %s: %s", drone, order.goal.in_words(), warning)
            return "", warning
        _log.warning("drone %d: no gateway has a route to it", drone)
        return f"no gateway has a route to drone {drone}", ""

    def _set_to_casus(self, request: srv.CasusRequest) -> srv.CasusResponse:
        self._order_case(request.caseID, at_once=True)
        return srv.CasusResponse()

    def _order_layout(self, request: srv.OrderLayoutRequest) -> srv.OrderLayoutResponse:
        return self._order_case(request.caseID, request.at_once)

    def _order_formation(self, request: srv.OrderFormationRequest) -> srv.OrderFormationResponse:
        answer = self._carry_out(request.name, _formation(request), request.at_once)
        return srv.OrderFormationResponse(*map(answer.__getattribute__, answer.__slots__))

    def _preview_layout(self, request: srv.PreviewLayoutRequest) -> srv.PreviewLayoutResponse:
        orders = self._orders_of(request.caseID)
        with _refusing():
            check_apart(dict(orders), flight_rules().clearance_m)
        known, missing = _in_fleet(orders, drones_if_known())
        found = self._standing.preview(known, request.at_once)
        if found is None:
            raise rospy.ServiceException("the state of the mesh is not known")
        return srv.PreviewLayoutResponse(
            found.duration_s,
            found.least_connected,
            found.out_of_reach,
            found.cut_off,
            list(found.stays),
            list(found.stays.values()),
            missing,
            found.in_words(),
        )

    def _withdraw_layout(self, request: srv.WithdrawLayoutRequest) -> srv.WithdrawLayoutResponse:
        words = self._standing.withdraw(request.id)
        unknown = f"there is no standing order {request.id}"
        return srv.WithdrawLayoutResponse(words is not None, words or unknown)

    def _order_case(
        self, case: int, at_once: bool, handle: actionlib.ServerGoalHandle | None = None
    ) -> srv.OrderLayoutResponse:
        return self._carry_out(f"layout {case}", self._orders_of(case), at_once, handle)

    def _carry_out(
        self,
        name: str,
        orders: Sequence[Order],
        at_once: bool,
        handle: actionlib.ServerGoalHandle | None = None,
    ) -> srv.OrderLayoutResponse:
        """Make a standing order of these.

        Raises ServiceException for places that are too near, or outside the fence.
        """
        fleet, rules = drones_if_known(), flight_rules()
        known, missing = _in_fleet(orders, fleet)
        with _refusing():
            check_apart(dict(orders), rules.clearance_m)
            for drone, goal in known:
                why_not = rules.fence.why_not(goal.to_vector())
                if why_not:
                    raise GoalRefused(f"nobody flies: the place of drone {drone} is {why_not}")
        if not self._gateway_is_there():
            raise rospy.ServiceException("no gateway is running")
        lost = self._standing.lost_routes(known)
        start = self._standing.give(name, orders, at_once, handle)
        if start.is_followed:
            summary = self._order_first(start, fleet, missing)
        else:
            summary = self._order_all(known, fleet, missing)
        words = "; ".join(filter(None, (summary.in_words(), lost.in_words())))
        level = logging.INFO if summary.is_complete and not lost else logging.WARNING
        _log.log(level, "%s: %s", name, words)
        return srv.OrderLayoutResponse(
            start.progress.number,
            summary.sent,
            summary.later,
            [*summary.there, *summary.flying],
            summary.no_route,
            summary.not_in_fleet,
            words,
        )

    def _order_first(
        self, start: LayoutStart, fleet: PresentDrones | None, missing: Sequence[int]
    ) -> OrderSummary:
        """Give the first orders of a standing order, to drones that may set out now."""
        drones, reasons = start.progress.drones, dict(start.progress.reasons)
        first = [order for order in start.orders if order.node_id not in missing]
        ordered = {order.node_id for order in first}
        outcomes = self._order(first, fleet, allow_shared_place=True)
        reasons.update({drone: answer.reason for drone, answer in outcomes.refused.items()})
        no_route, later, there, flying = (
            [drone for drone in drones[state] if drone not in ordered]
            for state in (PartState.WAITING, PartState.LATER, PartState.ARRIVED, PartState.FLYING)
        )
        no_route = outcomes.no_route + no_route
        return OrderSummary(outcomes.sent, no_route, missing, reasons, later, there, flying)

    def _orders_of(self, case: int) -> list[Order]:
        with _refusing():
            return self._layouts.orders(case)

    def _publish(self, orders: Sequence[Order], allow_shared_place: bool = False) -> None:
        checked = not (allow_shared_place and self._sharing.get_num_connections())
        topic = self._gateways if checked else self._sharing  # a gateway of 2019 only has the first
        for node_id, goal in orders:
            topic.publish(node_id, goal.latitude, goal.longitude, round(goal.height))

    def _order_all(
        self, orders: Sequence[Order], fleet: PresentDrones | None, missing: Sequence[int]
    ) -> OrderSummary:
        """Order the drones of a layout, in which only the final places matter.

        A drone that is refused because another one of the layout stands at its place is ordered
        again: the other one leaves that place.
        """
        outcomes = self._order(orders, fleet)
        members = {order.node_id for order in orders} - set(outcomes.no_route)
        leaving = {
            drone
            for drone, answer in outcomes.refused.items()
            if answer.outcome == FlightOrderAnswer.PLACE_TAKEN and answer.taken_by in members
        }
        again = self._order([o for o in orders if o.node_id in leaving], fleet, True)
        stay = {d: a for d, a in outcomes.refused.items() if d not in leaving}
        return OrderSummary(
            outcomes.sent + again.sent,
            outcomes.no_route + again.no_route,
            missing,
            {drone: answer.reason for drone, answer in {**stay, **again.refused}.items()},
        )

    def _order(
        self,
        orders: Sequence[Order],
        fleet: PresentDrones | None,
        allow_shared_place: bool = False,
    ) -> Outcomes:
        """Publish these orders in sequence, and collect the gateways' answers."""
        gateways = self._gateways.get_num_connections() if fleet is None else len(fleet.gateways)
        drones = [order.node_id for order in orders]
        return self._answers.await_outcomes(
            drones, lambda: self._publish(orders, allow_shared_place), gateways, ANSWERS_TIMEOUT_S
        )

    def _gateway_is_there(self) -> bool:
        """Whether a gateway subscribes; waits for one, which may be starting."""

        def is_there() -> bool:
            if self._gateways.impl is not None:
                self._gateways.impl.check()  # drops what a killed gateway left behind
            return self._gateways.get_num_connections() > 0

        return comes_true(is_there, WAIT_FOR_GATEWAY_S)


def _in_fleet(
    orders: Sequence[Order], fleet: PresentDrones | None
) -> tuple[list[Order], list[int]]:
    """The orders for drones of the fleet, and the other ids."""
    known = [o for o in orders if fleet is None or o.node_id in fleet.roles]
    return known, [order.node_id for order in orders if order not in known]


def _formation(request: srv.OrderFormationRequest) -> list[Order]:
    """The orders by descending id, as those of a layout. Raises ServiceException."""
    if not (request.name.isprintable() and 0 < len(request.name) <= MAX_NAME):
        raise rospy.ServiceException(f"invalid name: must be 1..{MAX_NAME} printable characters")
    goals = dict(zip(request.drones, map(location_of, request.places)))
    if not len(goals) == len(request.drones) == len(request.places) > 0:
        raise rospy.ServiceException(
            "a formation needs drones, each once, and a place for each of them"
        )
    orders = [Order(*item) for item in sorted(goals.items(), reverse=True)]
    for order in orders:
        _check(order)
    fleet = drones_if_known()
    moved = set(request.drones) - set(request.gateways)
    unnamed = sorted(moved.intersection(fleet.gateways if fleet else ()))
    if unnamed:
        raise rospy.ServiceException(
            f"would move {'gateway' if len(unnamed) == 1 else 'gateways'} {ids_in_words(unnamed)}: "
            "a gateway flies only if it is named as one (--gateway; gateways in OrderFormation)"
        )
    return orders


def _check(order: Order) -> None:
    """Raises ServiceException for an order that no drone can be given."""
    if order.node_id > MAX_NODE_ID:
        raise rospy.ServiceException(f"invalid drone id {order.node_id}: must be 0..{MAX_NODE_ID}")
    with _refusing():
        check_goal(*order.goal)


@contextlib.contextmanager
def _refusing() -> Iterator[None]:
    try:
        yield
    except (GoalRefused, UnknownCase) as error:
        raise rospy.ServiceException(str(error)) from None


def main() -> None:
    with OrderlyStop() as stop:  # first: rospy may swallow the KeyboardInterrupt of a Ctrl-C
        start_node(DroneManager.__doc__, "DroneManager", disable_signals=True)
        show_library_logs_on_rosout()
        layouts = or_exit(lambda: manager_layouts("~casus"))
        watch = MasterWatch()
        DroneManager(layouts, stop.begin_anew, watch)
        file = rospy.get_param("~casus", "") or "config/casus.yaml of this package"
        _log.info("%d layouts: built-in ones, and those of %s", len(layouts.cases), file)
        watch.start()
        stop.wait()
