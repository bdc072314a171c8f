"""rosrun drone_mesh fly: orders one drone to a place and shows its progress."""

from __future__ import annotations

import argparse
import math
import queue
import sys

import rospy

from drone_mesh.arguments import decimal, whole
from drone_mesh.communication.interfaces import MAX_NODE_ID, OrderState
from drone_mesh.drone.goal import MAX_COORDINATE_M, MAX_HEIGHT_M
from drone_mesh.drone.location import Location
from drone_mesh.errors import MeshError
from drone_mesh.formations.preview import lost_routes
from drone_mesh.msg import MeshEvent, MeshState
from drone_mesh.ros.graph import names
from drone_mesh.ros.graph.command_line import join_graph, run_tool
from drone_mesh.ros.graph.conversions import event_record, mesh_status
from drone_mesh.ros.services.flight_request import request_flight
from drone_mesh.state.orders import CLOCKS_DIFFER_S, OrderProgress

OUT_OF_REACH = "--out-of-reach"
SHOW_EVERY_S = 2.0  # simulated


def main() -> None:
    """Entry point of nodes/fly."""
    options = _parser().parse_args(_with_negative_numbers(rospy.myargv()[1:]))
    goal = Location(latitude=options.y, longitude=options.x, height=float(options.height))
    run_tool("fly", lambda: _run(options.drone, goal, options.out_of_reach))


def _with_negative_numbers(words: list[str]) -> list[str]:
    """The numbers after "--", as argparse would take one such as -1e3 for an option."""
    if {"-h", "--help"} & set(words):
        return words
    options = [word for word in words if word == OUT_OF_REACH]
    return [*options, "--", *(word for word in words if word != OUT_OF_REACH)]


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
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
    return parser


def _run(drone: int, goal: Location, out_of_reach: bool) -> int:
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
        return _follow(heard, OrderProgress(drone, goal, mesh.stamp_s - CLOCKS_DIFFER_S), drone)
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


def _follow(heard: queue.Queue[MeshEvent | MeshState], progress: OrderProgress, drone: int) -> int:
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
