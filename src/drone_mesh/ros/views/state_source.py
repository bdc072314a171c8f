"""The latest state of a mesh, live or from a bag, for the command-line tools."""

from __future__ import annotations

import argparse
import contextlib
from dataclasses import dataclass
from pathlib import Path
from typing import Iterator

import rospy

from drone_mesh.arguments import MOST, decimal, whole
from drone_mesh.errors import MeshError, naming_argument
from drone_mesh.msg import MeshState
from drone_mesh.ros.graph import names
from drone_mesh.ros.graph.command_line import join_graph
from drone_mesh.ros.graph.conversions import mesh_status
from drone_mesh.ros.views.bag import BagUnusable, RecordedMesh
from drone_mesh.state.model import MeshStatus

WAIT_S = 5.0  # wall time for a live state: it is latched, so it arrives at once or not at all
SPARE_S = 2.0  # so far behind the last state of a bag --at means that one
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
    add_run(parser)
    options = parser.parse_args(rospy.myargv()[1:])
    for name in ("at", "run"):
        if getattr(options, name) is not None and options.bag is None:
            parser.error(f"--{name} needs --bag")
    return options


def add_run(parser: argparse.ArgumentParser) -> None:
    """Add --run, for a recording that went on over a restart of the simulation."""
    parser.add_argument(
        "--run",
        type=whole(1, MOST),
        metavar="N",
        help="of the runs in the bag, whose time goes back where one begins: this one "
        "(default: the last)",
    )


def live_state() -> MeshStatus:
    """The latest state. Raises NoState."""
    try:
        return mesh_status(rospy.wait_for_message(names.STATE_TOPIC, MeshState, timeout=WAIT_S))
    except rospy.ROSException as error:
        raise NoState from error


@dataclass
class _Run:
    first_s: float
    last_s: float
    found: MeshStatus | None = None


@contextlib.contextmanager
def chosen_state(options: argparse.Namespace, name: str) -> Iterator[MeshStatus]:
    """The state that these options of `parse_with_bag` choose; a live one as this ROS node.

    At the end raises BagUnusable if anything is damaged in the bag.
    """
    if options.bag is None:
        join_graph(name)
        yield live_state()
        return
    recorded = RecordedMesh(options.bag)
    yield _state_in(recorded, options.at, options.run)
    recorded.raise_damage()


def _state_in(recorded: RecordedMesh, at_s: float | None, run: int | None) -> MeshStatus:
    """The last state of a run in a bag, or the last one up to `at_s`. Raises BagUnusable."""
    runs: dict[int, _Run] = {}
    with naming_argument("--bag ", recorded.path):
        for number, mesh in recorded.by_run():
            this = runs.setdefault(number, _Run(mesh.stamp_s, mesh.stamp_s))
            this.last_s = mesh.stamp_s
            if at_s is None or mesh.stamp_s <= at_s:
                this.found = mesh
        this = runs[recorded.chosen_run(len(runs), run)]
        if this.found is None:
            raise BagUnusable(
                f"{recorded.path}: no state up to {at_s:g} s; the recording starts at "
                f"{this.first_s:.1f} s of simulated time"
            )
        if at_s is not None and at_s > this.last_s + SPARE_S:
            raise BagUnusable(
                f"{recorded.path}: no state at {at_s:g} s; the recording ends at "
                f"{this.last_s:.1f} s of simulated time"
            )
    return this.found
