"""rosrun drone_mesh record: records the mesh of a namespace; used by record.launch."""

from __future__ import annotations

import argparse
import os
import re
import sys

import rospy

from drone_mesh.ros.graph import names
from drone_mesh.ros.graph.command_line import require_master, run_tool

RECORDED = "|".join(
    (
        names.STATE_TOPIC,
        names.EVENTS_TOPIC,
        names.PACKETS_TOPIC,
        "Nodes/[0-9]+/debug",
        names.DIAGNOSTICS_TOPIC,
        names.CLOCK_TOPIC,
    )
)


def main() -> None:
    """Entry point of nodes/record."""
    parser = argparse.ArgumentParser(
        prog="rosrun drone_mesh record",
        description="Records states, events, samples of packets, debug topics, diagnostics, the "
        "clock and the log until Ctrl-C. All other options are those of rosbag record.",
        epilog="Exit code: that of rosbag record; 2: no master.",
    )
    _ours, options = parser.parse_known_args(rospy.myargv()[1:])
    run_tool("record", lambda: _run(options))


def _run(options: list[str]) -> int:
    require_master()
    remappings = [word for word in sys.argv[1:] if ":=" in word]
    regex = f"{re.escape(rospy.get_namespace())}({RECORDED})|/rosout_agg"
    command = ["rosrun", "rosbag", "record", *options, "--regex", regex, *remappings]
    sys.stdout.flush()
    os.execvp(command[0], [*command, *names.REMAPPINGS])
