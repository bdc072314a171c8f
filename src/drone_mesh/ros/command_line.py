"""What the command line tools have in common: a passing node, and plain errors."""

from __future__ import annotations

import os
import sys
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
