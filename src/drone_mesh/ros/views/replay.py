"""rosrun drone_mesh replay: plays a recorded run with a single clock; used by replay.launch."""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path

import rosgraph
import rospy

from drone_mesh.arguments import MOST, decimal
from drone_mesh.errors import MeshError
from drone_mesh.ros.graph import names
from drone_mesh.ros.graph.command_line import require_master, run_tool
from drone_mesh.ros.views.bag import playable, topics_in_bag
from drone_mesh.ros.views.bag_file import BagDamaged

# Topics that rosbag must not publish, because running nodes do; --clock publishes the time.
NOT_PLAYED = {"/rosout", "/rosout_agg"}


def main() -> None:
    """Entry point of nodes/replay."""
    options = _parser().parse_args(rospy.myargv()[1:])
    run_tool("replay", lambda: _run(options))


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="rosrun drone_mesh replay",
        description="Plays a recorded run as if it were live, for rviz, the console and your own "
        "nodes. Skips the recorded clock, because rosbag publishes its own: with both, time "
        "would jump backwards.",
        epilog="The space bar pauses. Exit code: that of rosbag play; 2: unusable bag or no free "
        "master.",
    )
    parser.add_argument("bag", type=Path, help="the bag of the recorded run, or a gateway's record")
    parser.add_argument(
        "--rate",
        type=decimal(0.001, 1000.0),
        default=1.0,
        metavar="R",
        help="seconds of the bag per second (1)",
    )
    parser.add_argument(
        "--start",
        type=decimal(0.0, MOST),
        default=0.0,
        metavar="S",
        help="seconds of the bag to skip (0)",
    )
    return parser


def _run(options: argparse.Namespace) -> int:
    damage: list[BagDamaged] = []
    bag = playable(options.bag, damage)
    for error in damage:
        print(f"replay: {error}", file=sys.stderr)
    recorded, topics = topics_in_bag(bag)
    require_master()
    clock = rospy.resolve_name(names.CLOCK_TOPIC)
    publishers, _subscribers, _services = rosgraph.Master("/replay").getSystemState()
    others = dict(publishers).get(clock, [])
    if others:
        raise MeshError(
            f"{', '.join(others)} already publishes {clock}: stop it, play in another namespace "
            "(__ns:=again), or set ROS_MASTER_URI to another master"
        )
    rospy.set_param(names.SIM_TIME_PARAM, True)
    command = ["rosrun", "rosbag", "play", "--clock", "--keep-alive"]
    command += ["--rate", str(options.rate), "--start", str(options.start), str(bag)]
    command += ["--topics", *sorted(topics - NOT_PLAYED - {recorded + names.CLOCK_TOPIC})]
    # What was recorded in one namespace is played in that of this program.
    if recorded != rospy.get_namespace():
        of_the_mesh = [topic[len(recorded) :] for topic in topics if topic.startswith(recorded)]
        command += [f"{recorded}{topic}:={topic}" for topic in of_the_mesh]
    remappings = [word for word in sys.argv[1:] if ":=" in word]
    sys.stdout.flush()
    os.execvp(command[0], command + remappings)
