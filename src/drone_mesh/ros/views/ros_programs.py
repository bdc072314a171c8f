"""Commands that become a program of ROS, with its options as the mesh needs them.

`record`, `replay` and `rviz_window`, which record.launch, replay.launch and rviz.launch use.
"""

from __future__ import annotations

import argparse
import os
import re
import sys
from pathlib import Path

import rosgraph
import rospy

from drone_mesh.arguments import MOST, decimal
from drone_mesh.errors import MeshError
from drone_mesh.ros.graph import names
from drone_mesh.ros.graph.command_line import require_master, run_tool
from drone_mesh.ros.views.bag import RecordedMesh
from drone_mesh.view.window_process import require_screen

OF_THE_MESH = (names.STATE_TOPIC, names.EVENTS_TOPIC, names.PACKETS_TOPIC, "Nodes/[0-9]+/debug")
RECORDED = "|".join((*OF_THE_MESH, names.DIAGNOSTICS_TOPIC, names.CLOCK_TOPIC))
# Topics that rosbag must not publish, because running nodes do; --clock publishes the time.
NOT_PLAYED = {"/rosout", "/rosout_agg"}


def record() -> None:
    parser = argparse.ArgumentParser(
        prog="rosrun drone_mesh record",
        description="Records states, events, samples of packets, debug topics, diagnostics, the "
        "clock and the log until Ctrl-C. All other options are those of rosbag record.",
        epilog="Exit code: that of rosbag record; 2: no master.",
    )
    _ours, options = parser.parse_known_args(rospy.myargv()[1:])

    def run() -> int:
        require_master()
        regex = f"{re.escape(rospy.get_namespace())}({RECORDED})|/rosout_agg"
        command = ["rosbag", "record", *options, "--regex", regex, *_remappings()]
        return _become(*command, *names.REMAPPINGS)

    run_tool("record", run)


def replay() -> None:
    """Entry point of nodes/replay: plays a recorded run with a single clock."""
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
    options = parser.parse_args(rospy.myargv()[1:])
    run_tool("replay", lambda: _replay(options))


def _replay(options: argparse.Namespace) -> int:
    recorded = RecordedMesh(options.bag)
    bag = recorded.playable()
    for error in recorded.damage:
        print(f"replay: {error}", file=sys.stderr)
    namespace, topics = RecordedMesh(bag).topics()
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
    command = ["rosbag", "play", "--clock", "--keep-alive"]
    command += ["--rate", str(options.rate), "--start", str(options.start), str(bag)]
    command += ["--topics", *sorted(topics - NOT_PLAYED - {namespace + names.CLOCK_TOPIC})]
    # What was recorded in one namespace is played in that of this program.
    if namespace != rospy.get_namespace():
        of_the_mesh = [topic[len(namespace) :] for topic in topics if topic.startswith(namespace)]
        command += [f"{namespace}{topic}:={topic}" for topic in of_the_mesh]
    return _become(*command, *_remappings())


def rviz_window() -> None:
    parser = argparse.ArgumentParser(
        prog="rosrun drone_mesh rviz_window",
        description="Starts rviz; without a screen, prints one line and ends.",
        epilog="Exit code: that of rviz; 2: no screen.",
    )
    parser.add_argument("-d", dest="config", metavar="FILE", help="configuration file of rviz")
    parser.parse_args(rospy.myargv()[1:])

    def run() -> int:
        require_screen("rviz")
        # In a namespace, rviz shows the mesh of that namespace with any configuration.
        ours = [f"/{topic}:={topic}" for topic in (names.TF_TOPIC, names.MARKERS_TOPIC)]
        return _become("rviz", "rviz", *sys.argv[1:], *ours, *names.REMAPPINGS)

    run_tool("rviz_window", run)


def _remappings() -> list[str]:
    return [word for word in sys.argv[1:] if ":=" in word]


def _become(*words: str) -> int:
    """Go on as this program of a ROS package; does not return."""
    sys.stdout.flush()
    os.execvp("rosrun", ["rosrun", *words])
