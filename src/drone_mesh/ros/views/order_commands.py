"""Commands that order drones through the DroneManager and show how far they are: fly, layout."""

from __future__ import annotations

import argparse
import math
import queue
import signal
import sys
from pathlib import Path

import rospy

from drone_mesh import srv
from drone_mesh.arguments import ArgumentParser, decimal, whole
from drone_mesh.communication.interfaces import MAX_NODE_ID, OrderState
from drone_mesh.drone.goal import MAX_COORDINATE_M, MAX_HEIGHT_M
from drone_mesh.drone.location import Location
from drone_mesh.drone.roles import Role
from drone_mesh.earth_files import is_earth_file, read_placemarks
from drone_mesh.errors import MeshError
from drone_mesh.formations.layouts import MAX_CASE, MAX_NAME, Order, read_layout
from drone_mesh.formations.preview import lost_routes
from drone_mesh.msg import LayoutProgress, MeshEvent, MeshState
from drone_mesh.ros.graph import names
from drone_mesh.ros.graph.command_line import join_graph, run_tool
from drone_mesh.ros.graph.conversions import event_record, formation_request, mesh_status
from drone_mesh.ros.graph.parameters import earth_origin
from drone_mesh.ros.graph.persistent_service import ServiceGone, call_once
from drone_mesh.ros.services.flight_request import request_flight
from drone_mesh.ros.views.state_source import live_state
from drone_mesh.state.model import position_is_known
from drone_mesh.state.orders import CLOCKS_DIFFER_S, OrderProgress
from drone_mesh.stopping import StopRequest
from drone_mesh.yaml_file import read_text

OUT_OF_REACH = "--out-of-reach"
SHOW_EVERY_S = 2.0  # simulated


def fly() -> None:
    parser = ArgumentParser(
        prog="rosrun drone_mesh fly",
        description="Orders a drone to a place, through the mesh, and shows how far it is. "
        "After Ctrl-C the drone flies on.",
        epilog="Exit code: 0 it arrived, 1 it did not, 2 it was not ordered.",
    )
    limit_m = MAX_COORDINATE_M
    parser.add_argument("drone", type=whole(0, MAX_NODE_ID), help="its id")
    parser.add_argument("x", type=decimal(-limit_m, limit_m), help="metres")
    parser.add_argument("y", type=decimal(-limit_m, limit_m), help="metres")
    parser.add_argument(
        "height",
        nargs="?",
        default=0,
        type=whole(0, int(MAX_HEIGHT_M)),
        help="metres above the ground, a whole number (default: 0)",
    )
    parser.add_argument(
        OUT_OF_REACH,
        action="store_true",
        help="order it although it, or another drone, would have no route to a gateway then",
    )
    options = parser.parse_args(rospy.myargv()[1:])
    goal = Location(latitude=options.y, longitude=options.x, height=float(options.height))
    run_tool("fly", lambda: _fly(options.drone, goal, options.out_of_reach))


def _fly(drone: int, goal: Location, out_of_reach: bool) -> int:
    join_graph("order_flight")
    heard: queue.Queue[MeshEvent | MeshState] = queue.Queue()
    rospy.Subscriber(names.EVENTS_TOPIC, MeshEvent, heard.put)
    rospy.Subscriber(names.STATE_TOPIC, MeshState, heard.put, queue_size=1)
    mesh = mesh_status(_first_state(heard))
    lost = lost_routes(mesh, {drone: goal})
    if lost and not out_of_reach:
        raise MeshError(f"not ordered: {lost.in_words()}; {OUT_OF_REACH} orders it all the same")
    warning = request_flight(drone, goal)
    if warning:
        print(warning, flush=True)
    try:
        return _follow_flight(
            heard, OrderProgress(drone, goal, mesh.stamp_s - CLOCKS_DIFFER_S), drone
        )
    except KeyboardInterrupt:
        print(f"drone {drone} flies on", file=sys.stderr)
        raise


def _first_state(heard: queue.Queue[MeshEvent | MeshState]) -> MeshState:
    """The first state of the mesh. Raises MeshError if none comes."""
    while True:
        try:
            message = heard.get(timeout=10.0)
        except queue.Empty:
            raise MeshError("no state of a mesh: is the simulation running?") from None
        if isinstance(message, MeshState):
            return message


def _follow_flight(
    heard: queue.Queue[MeshEvent | MeshState], progress: OrderProgress, drone: int
) -> int:
    """Print the progress until the order is over; returns the exit code."""
    shown_s, shown = -math.inf, OrderState.SENT
    while not progress.is_over:
        try:
            message = heard.get(timeout=1.0)  # or else Ctrl-C would wait for a message
        except queue.Empty:
            continue
        if isinstance(message, MeshEvent):
            progress.on_event(event_record(message))
            continue
        now_s = message.header.stamp.to_sec()
        if now_s - shown_s >= SHOW_EVERY_S or progress.state is not shown:
            shown_s, shown = now_s, progress.state
            for node in message.nodes:
                if node.id == drone:
                    print(progress.in_words(node), flush=True)
    print(progress.in_words())
    return 0 if progress.state is OrderState.ARRIVED else 1


def layout() -> None:
    parser = ArgumentParser(
        prog="rosrun drone_mesh layout",
        description="Sends the drones of a layout to their places, and shows how far they are. "
        "They set out one after the other, so that none meets another and the mesh holds. "
        "Drones without a route are ordered as soon as they have one. Ctrl-C withdraws the "
        "layout; drones in flight fly on.",
        epilog="Exit code: 0 all drones are at their places, 1 some are not, 2 not ordered.",
    )
    what = parser.add_mutually_exclusive_group(required=True)
    what.add_argument(
        "case", nargs="?", type=whole(0, MAX_CASE), help="its number, such as 0 or 202"
    )
    what.add_argument(
        "--file",
        type=Path,
        help="a drawn one instead: points in GeoJSON or KML, whose names may say which drone they "
        "are for, or a layout file with one case",
    )
    parser.add_argument(
        "--origin",
        default="",
        metavar="LAT,LON,ALT",
        help="where x 0, y 0 is on the earth, for points in degrees (default: origin:= of the "
        "running simulation)",
    )
    parser.add_argument("--at-once", action="store_true", help="all drones set out together")
    parser.add_argument(
        "--gateway",
        type=whole(0, MAX_NODE_ID),
        action="append",
        default=[],
        metavar="ID",
        help="with --file: it may move this gateway; any other one in the file is refused",
    )
    run_tool("layout", lambda: _order_layout(parser.parse_args(rospy.myargv()[1:])))


def _order_layout(options: argparse.Namespace) -> int:
    join_graph("order_layout")
    heard: queue.Queue[LayoutProgress] = queue.Queue()
    orders = [] if options.file is None else _drawn(options.file, options.origin)
    for drone, goal in orders:
        print(f"drone {drone} to x {goal.longitude:g}, y {goal.latitude:g}, z {goal.height:g} m")
    rospy.Subscriber(names.LAYOUTS_TOPIC, LayoutProgress, heard.put)
    with StopRequest() as stop:  # from here on Ctrl-C finds a layout that it can withdraw
        signal.signal(signal.SIGINT, lambda _number, _frame: stop.make())
        try:
            answer: srv.OrderLayoutResponse | srv.OrderFormationResponse
            if options.file is None:
                request = srv.OrderLayoutRequest(options.case, options.at_once)
                answer = call_once(names.ORDER_LAYOUT_SERVICE, srv.OrderLayout, request)
            else:
                name = options.file.name[:MAX_NAME]
                drawn = formation_request(name, orders, options.at_once, options.gateway)
                answer = call_once(names.ORDER_FORMATION_SERVICE, srv.OrderFormation, drawn)
        except ServiceGone as error:
            raise MeshError(f"{error}: is the simulation running?") from None
        print(answer.message, flush=True)
        over = _follow_layout(heard, answer.id, stop)
        if over is not None:
            missing = over.waiting + over.refused + over.replaced + over.not_in_fleet
            return 1 if missing else 0
        words = call_once(
            names.WITHDRAW_LAYOUT_SERVICE, srv.WithdrawLayout, srv.WithdrawLayoutRequest(answer.id)
        ).message
    print(f"withdrawn, drones in flight fly on: {words}", file=sys.stderr)
    raise KeyboardInterrupt


def _drawn(file: Path, origin: str) -> list[Order]:
    """The orders that a file of places stands for. Raises MeshError."""
    text = read_text(file)
    if not is_earth_file(file.name):
        return read_layout(text, str(file))
    found = read_placemarks(text, str(file), earth_origin(origin))
    places = {
        node.id: Location.from_vector(node.position)
        for node in live_state().nodes
        if node.role == Role.ROUTER and position_is_known(node)
    }
    try:
        return [Order(*goal) for goal in found.goals(places).items()]
    except MeshError as error:
        raise MeshError(f"{file}: {error}") from error


def _follow_layout(
    heard: queue.Queue[LayoutProgress], number: int, stop: StopRequest
) -> LayoutProgress | None:
    """Print each change until it is over; returns the last. None: the program was told to end."""
    shown = ""
    while not stop.is_made():
        try:
            progress = heard.get(timeout=0.2)
        except queue.Empty:
            continue
        if progress.id != number:
            continue
        if progress.message != shown:
            shown = progress.message
            print(shown, flush=True)
        if progress.over:
            return progress
    return None
