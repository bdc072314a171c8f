"""rosrun drone_mesh layout: orders a layout and shows the progress of its drones."""

from __future__ import annotations

import argparse
import queue
import signal
import sys
from pathlib import Path

import rospy

from drone_mesh import srv
from drone_mesh.arguments import whole
from drone_mesh.communication.interfaces import MAX_NODE_ID
from drone_mesh.drone.location import Location
from drone_mesh.drone.roles import Role
from drone_mesh.earth_files import is_earth_file, read_placemarks
from drone_mesh.errors import MeshError
from drone_mesh.formations.layouts import MAX_CASE, MAX_NAME, Order, read_layout
from drone_mesh.msg import LayoutProgress
from drone_mesh.ros.graph import names
from drone_mesh.ros.graph.command_line import join_graph, run_tool
from drone_mesh.ros.graph.conversions import formation_request
from drone_mesh.ros.graph.parameters import earth_origin
from drone_mesh.ros.graph.persistent_service import ServiceGone, call_once
from drone_mesh.ros.views.state_source import live_state
from drone_mesh.state.model import position_is_known
from drone_mesh.stopping import StopRequest
from drone_mesh.yaml_file import read_text


def main() -> None:
    """Entry point of nodes/layout."""
    run_tool("layout", lambda: _run(_parser().parse_args(rospy.myargv()[1:])))


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
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
    return parser


def _run(options: argparse.Namespace) -> int:
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
        over = _follow(heard, answer.id, stop)
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


def _follow(
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
