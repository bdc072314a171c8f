"""roslaunch with an exit status: 1 if a node that the launch requires fails.

`roslaunch` itself exits with 0 then, so a script cannot see that a launch failed. What roslaunch
takes for the address of a master or for a namespace, and is none, is an error here, before anything
starts; so is a place or a port that the web console of factory.launch could only refuse later.
`scripts/run` uses it: python3 -m drone_mesh.ros.graph.launching [what roslaunch accepts ...]
"""

from __future__ import annotations

import os
import signal
import sys
from typing import ClassVar, Mapping

import roslaunch
import roslaunch.parent
from roslaunch.pmon import ProcessListener

from drone_mesh.console import DEFAULT_PORT
from drone_mesh.drone.geodesy import Origin
from drone_mesh.errors import MeshError
from drone_mesh.ros.graph.master import ANSWER_TIMEOUT_S, bounded_master
from drone_mesh.ros.graph.names import check_namespace
from drone_mesh.web import LOOPBACK
from drone_mesh.web.listening import listen, port_of

EXIT_FAILED = 1


class WatchedLaunch(roslaunch.parent.ROSLaunchParent, ProcessListener):
    """A launch that records which required nodes failed."""

    failed: ClassVar[list[str]] = []  # of the one launch of this process; the monitor's thread adds

    def _start_infrastructure(self) -> None:
        # The constructor's listeners are added only after all nodes have started, too late for a
        # node that fails at once.
        super()._start_infrastructure()
        self.pm.add_process_listener(self)

    def process_died(self, process_name: str, exit_code: int | None) -> None:
        """Called for a process that ends by itself; not for those that roslaunch stops."""
        process = self.pm.get_process(process_name)
        if exit_code and process is not None and process.required:
            self.failed.append(process_name)


def _end(_number: int, _frame: object) -> None:
    """End the launch, because a node cannot start with its arguments."""
    WatchedLaunch.failed.append("")
    os.kill(os.getpid(), signal.SIGINT)


def _check(given: Mapping[str, str]) -> None:
    """Raises MeshError about arguments with which nodes could not start."""
    if "namespace" in given:
        check_namespace(given["namespace"])
    if given.get("origin"):
        Origin.parse(given["origin"])
    port = port_of(given.get("console_port", DEFAULT_PORT))
    if given.get("console", "").lower() in ("true", "1") or given.get("demo"):
        listen(LOOPBACK, port).close()


def main() -> None:
    """Launch, and exit with 1 if a required node failed."""
    try:
        bounded_master("roslaunch", ANSWER_TIMEOUT_S)
        _check(dict(word.split(":=", 1) for word in sys.argv if ":=" in word))
    except MeshError as error:
        sys.exit(f"roslaunch: {error}")
    signal.signal(signal.SIGUSR1, _end)  # from command_line.end_launch
    roslaunch.parent.ROSLaunchParent = WatchedLaunch  # type: ignore[misc]
    roslaunch.main(["roslaunch", *sys.argv[1:]])
    if WatchedLaunch.failed:
        sys.exit(EXIT_FAILED)


if __name__ == "__main__":
    main()
