"""rosrun drone_mesh layout: orders a layout and shows the progress of its drones."""

from __future__ import annotations

import argparse
import queue
import signal
import sys

import rospy

from drone_mesh.arguments import whole
from drone_mesh.errors import MeshError
from drone_mesh.layouts import MAX_CASE
from drone_mesh.msg import LayoutProgress
from drone_mesh.ros.graph import names
from drone_mesh.ros.graph.command_line import join_graph, run_tool
from drone_mesh.ros.graph.persistent_service import ServiceGone, ServiceRefused, call_once
from drone_mesh.srv import OrderLayout, OrderLayoutRequest, WithdrawLayout, WithdrawLayoutRequest
from drone_mesh.stopping import StopRequest


def main() -> None:
    """Entry point of nodes/layout."""
    options = _parser().parse_args(rospy.myargv()[1:])
    run_tool("layout", lambda: _run(options.case, options.at_once))


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="rosrun drone_mesh layout",
        description="Sends the drones of a layout to their places, and shows how far they are. "
        "They set out one after the other, so that none meets another and the mesh holds. "
        "Drones without a route are ordered as soon as they have one. Ctrl-C withdraws the "
        "layout; drones in flight fly on.",
        epilog="Exit code: 0 all drones are at their places, 1 some are not, 2 not ordered.",
    )
    parser.add_argument("case", type=whole(0, MAX_CASE), help="its number, such as 0 or 202")
    parser.add_argument("--at-once", action="store_true", help="all drones set out together")
    return parser


def _run(case: int, at_once: bool) -> int:
    join_graph("order_layout")
    heard: queue.Queue[LayoutProgress] = queue.Queue()
    rospy.Subscriber(names.LAYOUTS_TOPIC, LayoutProgress, heard.put)
    with StopRequest() as stop:  # from here on Ctrl-C finds a layout that it can withdraw
        signal.signal(signal.SIGINT, lambda _number, _frame: stop.make())
        try:
            request = OrderLayoutRequest(case, at_once)
            answer = call_once(names.ORDER_LAYOUT_SERVICE, OrderLayout, request)
        except ServiceGone as error:
            raise MeshError(f"{error}: is the simulation running?") from None
        except ServiceRefused as error:
            raise MeshError(str(error)) from None
        print(answer.message, flush=True)
        over = _follow(heard, answer.id, stop)
        if over is not None:
            missing = over.waiting + over.refused + over.replaced + over.not_in_fleet
            return 1 if missing else 0
        words = call_once(
            names.WITHDRAW_LAYOUT_SERVICE, WithdrawLayout, WithdrawLayoutRequest(answer.id)
        ).message
    print(f"withdrawn, drones in flight fly on: {words}", file=sys.stderr)
    raise KeyboardInterrupt


def _follow(
    heard: queue.Queue[LayoutProgress], number: int, stop: StopRequest
) -> LayoutProgress | None:
    """Print each change until it is over; returns the last. None: the program shall stop."""
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
