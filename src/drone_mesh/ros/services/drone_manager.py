"""DroneManager: orders to drones, through the gateways (docs/protocol.md, "Drone manager")."""

from __future__ import annotations

import logging
import time

import rospy

from drone_mesh.communication.interfaces import MAX_NODE_ID
from drone_mesh.drone.goal import check_goal
from drone_mesh.drone.interfaces import Location
from drone_mesh.errors import GoalRefused
from drone_mesh.layouts import Layouts, UnknownCase
from drone_mesh.msg import RequestGatewayDroneFlight
from drone_mesh.ros.graph import names
from drone_mesh.ros.graph.command_line import prepare_node
from drone_mesh.ros.graph.conversions import flight_order, location_of
from drone_mesh.ros.graph.logs import show_library_logs_on_rosout
from drone_mesh.ros.graph.master_watch import MasterWatch
from drone_mesh.ros.graph.parameters import file_parameter, or_stop
from drone_mesh.srv import (
    Casus,
    CasusRequest,
    CasusResponse,
    RequestDroneFlight,
    RequestDroneFlightRequest,
    RequestDroneFlightResponse,
)

WAIT_FOR_GATEWAY_S = 3.0  # of wall time (docs/protocol.md, "Drone manager")
LOOK_PERIOD_S = 0.05
ORDERS_IN_QUEUE = 512  # two whole fleets

_log = logging.getLogger(__name__)


class DroneManager:
    """Passes orders from users and layouts to the gateways.

    Parameters (private): ~casus (a YAML file of layouts; config/casus.yaml by default)
    Publishes:  /gateway (RequestGatewayDroneFlight)
    Services:   /DroneManager/requestDroneMovement (RequestDroneFlight), /DroneManager/SetToCasus
                (Casus)
    """

    # Its only state, the layouts, never changes, so the handlers may run in parallel.

    def __init__(self, layouts: Layouts) -> None:
        self._layouts = layouts
        self._gateways = rospy.Publisher(
            names.GATEWAY_TOPIC,
            RequestGatewayDroneFlight,
            tcp_nodelay=True,
            queue_size=ORDERS_IN_QUEUE,
        )
        rospy.Service(names.REQUEST_MOVEMENT_SERVICE, RequestDroneFlight, self._request_movement)
        rospy.Service(names.SET_TO_CASUS_SERVICE, Casus, self._set_to_casus)

    def _request_movement(self, request: RequestDroneFlightRequest) -> RequestDroneFlightResponse:
        """Status 1: at least one gateway received the order; 0: there is no gateway."""
        goal = location_of(request)
        try:
            check_goal(*goal)
        except GoalRefused as error:
            raise rospy.ServiceException(str(error)) from None
        if request.ID > MAX_NODE_ID:
            raise rospy.ServiceException(f"invalid drone id {request.ID}: must be 0..{MAX_NODE_ID}")
        if not self._gateway_is_there():
            _log.warning("drone %d: order dropped, there is no gateway", request.ID)
            return RequestDroneFlightResponse(status=0)
        self._order(request.ID, goal)
        return RequestDroneFlightResponse(status=1)

    def _set_to_casus(self, request: CasusRequest) -> CasusResponse:
        try:
            orders = self._layouts.orders(request.caseID)
        except UnknownCase as error:
            raise rospy.ServiceException(str(error)) from None
        if not self._gateway_is_there():
            raise rospy.ServiceException("no gateway is running")
        _log.info("case %d: ordering %d drones to their places", request.caseID, len(orders))
        for node_id, goal in orders:
            self._order(node_id, goal)
        return CasusResponse()

    def _order(self, node_id: int, goal: Location) -> None:
        self._gateways.publish(flight_order(node_id, goal))

    def _gateway_is_there(self) -> bool:
        """Whether a gateway subscribes; waits for one, since it may be starting."""
        deadline_s = time.monotonic() + WAIT_FOR_GATEWAY_S
        while not rospy.is_shutdown():
            if self._gateways.impl is not None:
                self._gateways.impl.check()  # drops what a killed gateway left behind
            if self._gateways.get_num_connections() > 0:
                return True
            if time.monotonic() >= deadline_s:
                return False
            time.sleep(LOOK_PERIOD_S)
        return False


def main() -> None:
    """Run the node."""
    prepare_node(DroneManager.__doc__)
    rospy.init_node("DroneManager")
    show_library_logs_on_rosout()
    path = or_stop(lambda: file_parameter("casus", "casus.yaml"))
    layouts = or_stop(lambda: Layouts.load(path))
    DroneManager(layouts)
    _log.info("%d layouts, built in and from %s", len(layouts.cases), path)
    MasterWatch().start()
    rospy.spin()
