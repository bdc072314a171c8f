"""rosrun drone_mesh rviz_window: rviz, if there is a screen; used by rviz.launch."""

from __future__ import annotations

import argparse
import os
import sys

import rospy

from drone_mesh.ros.graph import names
from drone_mesh.ros.graph.command_line import run_tool
from drone_mesh.view.window_process import require_screen


def main() -> None:
    """Entry point of nodes/rviz_window."""
    parser = argparse.ArgumentParser(
        prog="rosrun drone_mesh rviz_window",
        description="Starts rviz; without a screen, prints one line and ends.",
        epilog="Exit code: that of rviz; 2: no screen.",
    )
    parser.add_argument("-d", dest="config", metavar="FILE", help="configuration file of rviz")
    parser.parse_args(rospy.myargv()[1:])
    run_tool("rviz_window", _run)


def _run() -> int:
    require_screen("rviz")
    sys.stdout.flush()
    # In a namespace, rviz shows the mesh of that namespace with any configuration.
    ours = [f"/{topic}:={topic}" for topic in (names.TF_TOPIC, names.MARKERS_TOPIC)]
    os.execvp("rosrun", ["rosrun", "rviz", "rviz", *sys.argv[1:], *ours, *names.REMAPPINGS])
