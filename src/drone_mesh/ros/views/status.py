"""rosrun drone_mesh status: the state of the mesh as a table."""

from __future__ import annotations

import argparse
import os
import sys
import threading
import time

import rospy

from drone_mesh.msg import MeshState
from drone_mesh.ros.graph import names
from drone_mesh.ros.graph.command_line import join_graph, run_tool
from drone_mesh.ros.graph.conversions import mesh_status
from drone_mesh.ros.graph.master import MasterWatch, master_answers
from drone_mesh.ros.views.state_source import (
    OLD_STATE_S,
    WAIT_S,
    NoState,
    chosen_state,
    parse_with_bag,
)
from drone_mesh.state.condition import all_connected, find_trouble
from drone_mesh.state.model import MeshStatus
from drone_mesh.view.table import mesh_table

WATCH_PERIOD_S = 1.0
CLEAR_SCREEN = "\x1b[H\x1b[2J"


def main() -> None:
    parser = argparse.ArgumentParser(
        prog="rosrun drone_mesh status",
        description="Prints the state of the mesh as a table.",
        epilog="Exit code: 0 all nodes that are on are connected, 1 some are not, "
        "2 unknown (no master, no mesh, no such bag).",
    )
    parser.add_argument("-w", "--watch", action="store_true", help="repeat every second")
    parser.add_argument(
        "--colour",
        choices=("auto", "always", "never"),
        default="auto",
        help="auto (default): on a terminal, unless NO_COLOR is set",
    )
    options = parse_with_bag(parser)
    run_tool("status", lambda: _run(options))


def _run(options: argparse.Namespace) -> int:
    colours = options.colour == "always" or (
        options.colour == "auto" and sys.stdout.isatty() and "NO_COLOR" not in os.environ
    )
    if options.watch and options.bag is None:
        return _watch(colours)
    with chosen_state(options, "mesh_status") as mesh:
        print(mesh_table(mesh, colours))
    return _code(mesh)


def _code(mesh: MeshStatus) -> int:
    return 0 if all_connected(find_trouble(mesh.nodes)) else 1


def _watch(colours: bool) -> int:
    """Print the table until Ctrl-C. The subscriber's thread only replaces `latest`."""
    latest: list[tuple[MeshStatus, float]] = []
    came = threading.Event()

    def keep(message: MeshState) -> None:
        latest[:] = [(mesh_status(message), time.monotonic())]
        came.set()

    join_graph("mesh_status")
    rospy.Subscriber(names.STATE_TOPIC, MeshState, keep, queue_size=1)
    MasterWatch().start()  # states arrive again after a restart of the master
    if not came.wait(WAIT_S):
        raise NoState
    try:
        while True:
            mesh, came_s = latest[0]
            text = mesh_table(mesh, colours)
            age_s = time.monotonic() - came_s
            if age_s > OLD_STATE_S:
                text += f"\nno state for {age_s:.0f} s"
                if not master_answers():
                    text += ", and the ROS master does not answer"
            print(f"{CLEAR_SCREEN if colours else ''}{text}", flush=True)
            time.sleep(WATCH_PERIOD_S)
    except KeyboardInterrupt:
        return _code(latest[0][0])
