"""Shared by all programs: --help, a check for the master, and errors of one line."""

from __future__ import annotations

import argparse
import inspect
import os
import sys
from pathlib import Path
from typing import Callable

import rosgraph
import rospy

from drone_mesh.errors import MeshError
from drone_mesh.stopping import quiet_on_closed_pipe

FAILED = 2  # exit code: the tool could not do its work; 1 means that it did, with a bad result


class NoMaster(MeshError):
    """No ROS master answers."""


def require_master() -> None:
    """Raises NoMaster, which names the address that was tried and the remedy."""
    if not rosgraph.is_master_online():
        uri = os.environ.get("ROS_MASTER_URI", "ROS_MASTER_URI (not set)")
        raise NoMaster(
            f"no ROS master at {uri}: start the simulation (roslaunch drone_mesh factory.launch), "
            "or set ROS_MASTER_URI to the address of the running one"
        )


def join_graph(name: str) -> None:
    """Register as an anonymous node without rospy's signal handlers. Raises NoMaster."""
    require_master()
    rospy.init_node(name, anonymous=True, disable_signals=True, disable_rosout=True)


def prepare_node(about: str | None) -> None:
    """Answer --help; exit with one line on unknown arguments, or when there is no master.

    Call this before the node registers: registering ends a running node of the same name. `about`
    describes the node.
    """
    program = Path(sys.argv[0]).name
    argparse.ArgumentParser(
        prog=f"rosrun drone_mesh {program}",
        description=inspect.cleandoc(about or ""),
        epilog="Set private parameters with _name:=value, and remap other names with old:=new.",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    ).parse_args(rospy.myargv()[1:])
    try:
        require_master()
    except NoMaster as error:
        print(f"{program}: {error}", file=sys.stderr)
        sys.exit(FAILED)


def run_tool(name: str, work: Callable[[], int]) -> None:
    """Run a tool and exit with its code. A MeshError becomes one line; Ctrl-C is silent."""
    try:
        code = quiet_on_closed_pipe(work)()
    except MeshError as error:
        print(f"{name}: {error}", file=sys.stderr)
        code = FAILED
    except KeyboardInterrupt:
        code = 130  # as in a shell for SIGINT
    sys.exit(code)
