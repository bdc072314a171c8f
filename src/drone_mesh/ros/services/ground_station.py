"""The node /ground_station: a simulated mesh for MAVLink ground stations and Cursor on Target."""

from __future__ import annotations

import threading
from typing import Callable

import rospy

from drone_mesh.drone.location import Location
from drone_mesh.ground_station.order_queue import OrderQueue
from drone_mesh.ground_station.server import GroundStationServer
from drone_mesh.ground_station.settings import GroundStationSettings
from drone_mesh.ground_station.vehicles import Vehicle, vehicles_of_state
from drone_mesh.msg import MeshEvent, MeshState
from drone_mesh.ros.graph import names
from drone_mesh.ros.graph.command_line import start_node
from drone_mesh.ros.graph.conversions import event_record, mesh_status
from drone_mesh.ros.graph.fleet_parameter import get_fleet_parameter
from drone_mesh.ros.graph.logs import show_library_logs_on_rosout
from drone_mesh.ros.graph.master import MasterWatch
from drone_mesh.ros.graph.orderly_stop import OrderlyStop
from drone_mesh.ros.graph.parameters import earth_origin, or_exit
from drone_mesh.ros.graph.simulation import Run, run_of
from drone_mesh.ros.graph.waiting import comes_true
from drone_mesh.ros.services.flight_request import FlightNotOrdered, request_flight

WAIT_S = 600.0  # wall: a large fleet takes its time to start


class GroundStationNode:
    """Shows ground stations the nodes that have a gateway, and passes their orders on.

    Parameters (private): ~addresses and ~cot (str): as --ground-station and --cot of
    raspberry_gateway, with spaces between several; ~may_order (bool); ~key_file (str): an absolute
    path. /drone_mesh/origin (str)
    Subscribes: /mesh/state (MeshState), /mesh/events (MeshEvent)
    Calls:      /DroneManager/orderFlight (OrderFlight)
    """

    # Threads of rospy convert what comes in; orders wait for the service in a thread of their own.

    def __init__(self, settings: GroundStationSettings, on_other_run: Callable[[], None]) -> None:
        """Serve until `stop`. `on_other_run` is called when the world was replaced."""
        timing = get_fleet_parameter().node.timing
        self._orders = OrderQueue(_carry_out)
        self._server = GroundStationServer(
            settings, earth_origin(""), timing.check_period_s, self._orders.give
        )
        self._run: Run | None = None
        self._on_other_run = on_other_run
        self._vehicles: list[Vehicle] = []
        self._lock = threading.Lock()  # rospy may have a thread per publisher
        self._server.start()
        rospy.Subscriber(names.STATE_TOPIC, MeshState, self._show, queue_size=1)
        rospy.Subscriber(
            names.EVENTS_TOPIC, MeshEvent, lambda event: self._server.tell(event_record(event))
        )

    def stop(self) -> None:
        """End all threads."""
        self._server.stop()
        self._orders.stop()

    def _show(self, state: MeshState) -> None:
        with self._lock:
            before, self._run = self._run, run_of(state)
            if before not in (None, self._run):
                self._on_other_run()
                return
            mesh = mesh_status(state)
            self._vehicles = vehicles_of_state(mesh, self._vehicles)
            self._server.show(self._vehicles, mesh.stamp_s)


def _carry_out(node: int, goal: Location) -> str:
    try:
        request_flight(node, goal)
    except FlightNotOrdered as error:
        return str(error)
    return ""


def main() -> None:
    start_node(GroundStationNode.__doc__, "ground_station", disable_signals=True)
    show_library_logs_on_rosout()
    with OrderlyStop() as stop:
        stations, cot = (str(rospy.get_param(name, "")).split() for name in ("~addresses", "~cot"))
        may_order, key = rospy.get_param("~may_order", False), str(rospy.get_param("~key_file", ""))
        settings = or_exit(lambda: GroundStationSettings.parse(stations, cot, may_order, key))
        if not comes_true(lambda: rospy.has_param(names.FLEET_PARAM), WAIT_S, stop.requested):
            return
        node = or_exit(lambda: GroundStationNode(settings, stop.begin_anew))
        MasterWatch().start()
        try:
            stop.wait()
        finally:
            node.stop()
