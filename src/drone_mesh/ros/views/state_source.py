"""The latest state of a mesh, live or from a bag, for the command-line tools."""

from __future__ import annotations

import argparse
from pathlib import Path

import rospy

from drone_mesh.arguments import MOST, decimal
from drone_mesh.errors import MeshError, naming_argument
from drone_mesh.msg import MeshState
from drone_mesh.ros.graph import names
from drone_mesh.ros.graph.conversions import mesh_status
from drone_mesh.ros.views.bag import BagUnusable, no_states, read_states
from drone_mesh.state.model import MeshStatus

WAIT_S = 5.0  # wall time for a live state: it is latched, so it arrives at once or not at all
SPARE_S = 2.0  # our choice: so far behind the last state of a bag --at means that one
OLD_STATE_S = 3.0  # wall time without a state after which the tools and the page show a warning


class NoState(MeshError):
    """There is a master, but no node publishes the state of a mesh."""

    def __init__(self) -> None:
        super().__init__(
            f"no state on {rospy.resolve_name(names.STATE_TOPIC)}: is a simulation running "
            "(roslaunch drone_mesh factory.launch)?"
        )


def parse_with_bag(parser: argparse.ArgumentParser) -> argparse.Namespace:
    """Parse the command line after adding --bag and --at to `parser`."""
    parser.add_argument(
        "--bag", type=Path, help="read the state from a bag instead of the live one"
    )
    parser.add_argument(
        "--at",
        type=decimal(0, MOST),
        metavar="S",
        help="with --bag: the state at this simulated time (default: the last one)",
    )
    options = parser.parse_args(rospy.myargv()[1:])
    if options.at is not None and options.bag is None:
        parser.error("--at needs --bag")
    return options


def live_state() -> MeshStatus:
    """The latest state. Raises NoState."""
    try:
        return mesh_status(rospy.wait_for_message(names.STATE_TOPIC, MeshState, timeout=WAIT_S))
    except rospy.ROSException as error:
        raise NoState from error


def state_in_bag(path: Path, at_s: float | None) -> MeshStatus:
    """The last state in a bag, or the last one up to `at_s`. Raises BagUnusable."""
    found, is_behind = None, at_s is not None  # the end of the recording
    with naming_argument("--bag ", path):
        for mesh in read_states(path):
            if at_s is not None and mesh.stamp_s > at_s:
                if found is None:
                    raise BagUnusable(
                        f"{path}: no state up to {at_s:g} s; the recording starts at "
                        f"{mesh.stamp_s:.1f} s of simulated time"
                    )
                is_behind = False
                break
            found = mesh
        if found is None:
            raise no_states(path)
        if at_s is not None and is_behind and at_s > found.stamp_s + SPARE_S:
            raise BagUnusable(
                f"{path}: no state at {at_s:g} s; the recording ends at {found.stamp_s:.1f} s of "
                "simulated time"
            )
    return found
