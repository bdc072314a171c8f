"""Shared by all programs: --help, a check for the master, and errors of one line."""

from __future__ import annotations

import argparse
import inspect
import os
import signal
import sys
import threading
from pathlib import Path
from typing import Callable

import rosgraph
import rospy

from drone_mesh.errors import ConfigurationError, MeshError
from drone_mesh.ros.graph import names
from drone_mesh.ros.graph.master import (
    ANSWER_TIMEOUT_S,
    NO_ANSWER,
    bounded_master,
    bounded_proxy,
    master_answers,
)
from drone_mesh.ros.graph.orderly_stop import end_without_dead_master
from drone_mesh.ros.graph.resting_clock import RestingClock
from drone_mesh.stopping import ends_as

SPEAKER_VARIABLE = "DRONE_MESH_SPEAKER"  # the node of a launch file that says why it cannot start
LAUNCHING = "drone_mesh.ros.graph.launching"  # the module that is roslaunch with an exit status
FAILED = 2  # exit code: the tool could not do its work; 1 means that it did, with a bad result


def require_master() -> None:
    """Raises MeshError, which names the address that was tried and the remedy."""
    if not master_answers():
        uri = os.environ.get("ROS_MASTER_URI", "ROS_MASTER_URI (not set)")
        raise MeshError(
            f"no ROS master at {uri}: start the simulation (roslaunch drone_mesh factory.launch), "
            "or set ROS_MASTER_URI to the address of the running one"
        )


def join_graph(name: str) -> None:
    """Register as an anonymous node without rospy's signal handlers. Raises MeshError."""
    require_master()
    rospy.init_node(name, argv=_words(), anonymous=True, disable_signals=True, disable_rosout=True)


def _words() -> list[str]:
    """The command line of a node, whose clock is that of its namespace."""
    return [*sys.argv, *names.REMAPPINGS]


def _require_namespace() -> None:
    """Raises ConfigurationError if the names of a simulation are invalid in our namespace."""
    try:
        names.check_namespace(rospy.get_namespace())
    except ConfigurationError:
        if SPEAKER_VARIABLE in os.environ:
            sys.exit(FAILED)
        raise


def _require_free_name(name: str) -> None:
    """Raises MeshError: the master would end the node that has this name."""
    given = [word[len("__name:=") :] for word in sys.argv if word.startswith("__name:=")]
    full = rospy.resolve_name(given[-1] if given else name)
    if _is_taken(full):
        speaker = os.environ.get(SPEAKER_VARIABLE)
        if speaker and _is_taken(rospy.resolve_name(speaker)):
            sys.exit(FAILED)
        raise MeshError(
            f"{full} already runs on this master: stop it, give this one a namespace "
            "(namespace:=site_a for factory.launch, __ns:=site_a for rosrun), or set "
            "ROS_MASTER_URI to another master"
        )


def _is_taken(full: str) -> bool:
    try:
        uri = bounded_master(full, ANSWER_TIMEOUT_S).lookupNode(full)
        answer = bounded_proxy(uri, ANSWER_TIMEOUT_S).getName(full)  # code, text, name
    except (rosgraph.MasterException, *NO_ANSWER):
        return False  # it never ran, or it died
    return isinstance(answer, list) and full in answer


def _shut_down_beside(number: int, _frame: object) -> None:
    """Handle a signal in a thread of its own, for which the interpreter waits at its end.

    rospy's own handler calls the master while the interrupted thread may hold the lock of the
    connection to it. Then the node, mostly one that starts, would hang for ever.
    """
    end_without_dead_master()
    threading.Thread(
        target=rospy.signal_shutdown, args=(f"signal {number}",), name="shutdown"
    ).start()


def start_node(
    about: str | None, name: str, *, disable_signals: bool = False, every_tick: bool = False
) -> None:
    """Register as a node. With --help, print `about` and exit instead.

    SIGINT and SIGTERM end it, unless `disable_signals`. `every_tick`: it follows each tick of the
    simulated clock, which others read in bunches.
    Exits with one line on unknown arguments, without a master, and if a node of this name runs.
    """
    program = Path(sys.argv[0]).name
    argparse.ArgumentParser(
        prog=f"rosrun drone_mesh {program}",
        description=inspect.cleandoc(about or ""),
        epilog="Set private parameters with _name:=value, and remap other names with old:=new.",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    ).parse_args(rospy.myargv()[1:])
    try:
        _require_namespace()
        require_master()
        _require_free_name(name)
    except MeshError as error:
        print(f"{program}: {error}", file=sys.stderr)
        sys.exit(FAILED)
    if not disable_signals:
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, _shut_down_beside)
    try:
        rospy.init_node(name, argv=_words(), disable_signals=True)
    except rospy.ROSException as error:  # it is told to end while it registers
        print(f"{program}: {error}", file=sys.stderr)
        sys.exit(FAILED)
    if not every_tick and rospy.get_param(names.SIM_TIME_PARAM, False):
        RestingClock()


def end_launch() -> None:
    """End the roslaunch that started this node: it would start the node again and again."""
    parent = os.getppid()
    command = Path(f"/proc/{parent}/cmdline").read_bytes()
    if LAUNCHING.encode() in command:
        os.kill(parent, signal.SIGUSR1)
    elif b"/roslaunch\0" in command:
        os.kill(parent, signal.SIGINT)


def run_tool(name: str, work: Callable[[], int]) -> None:
    """Run a tool and exit with its code. A MeshError becomes one line; Ctrl-C is silent."""
    sys.exit(ends_as(name, FAILED)(work)())
