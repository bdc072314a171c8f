"""What the command line tools have in common: a passing node, and plain errors."""

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

FAILED = 2  # exit code: the tool could not do its work; 1 is left for "done, and the news is bad"


class NoMaster(MeshError):
    """There is no ROS master to talk to."""


def require_master() -> None:
    """Raises NoMaster, which says where it was looked for and what to do."""
    if not rosgraph.is_master_online():
        uri = os.environ.get("ROS_MASTER_URI", "ROS_MASTER_URI, which is not set")
        raise NoMaster(
            f"no ROS master at {uri}: start the simulation (roslaunch drone_mesh factory.launch), "
            "or set ROS_MASTER_URI to where it runs"
        )


def join_graph(name: str) -> None:
    """Become an anonymous node that leaves Ctrl-C to the program. Raises NoMaster."""
    require_master()
    rospy.init_node(name, anonymous=True, disable_signals=True, disable_rosout=True)


def prepare_node(about: str | None) -> None:
    """Answer --help, refuse what is no remapping, and say so if there is no master; then it exits.

    To be called before a node registers: that would end the one that runs under its name.
    `about` describes the node.
    """
    program = Path(sys.argv[0]).name
    argparse.ArgumentParser(
        prog=f"rosrun drone_mesh {program}",
        description=inspect.cleandoc(about or ""),
        epilog="Private parameters are given as _name:=value, other names as old:=new.",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    ).parse_args(rospy.myargv()[1:])
    try:
        require_master()
    except NoMaster as error:
        print(f"{program}: {error}", file=sys.stderr)
        sys.exit(FAILED)


def run_tool(name: str, work: Callable[[], int]) -> None:
    """Run a tool to its exit code. Errors of ours become one line; Ctrl-C is silent."""
    try:
        code = work()
        sys.stdout.flush()
    except MeshError as error:
        print(f"{name}: {error}", file=sys.stderr)
        code = FAILED
    except KeyboardInterrupt:
        code = 130  # as a shell has it for SIGINT
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        code = 141  # as a shell has it for SIGPIPE
    sys.exit(code)
