"""roslaunch with an exit status: 1 if a node that the launch requires fails.

`roslaunch` itself exits with 0 then, so a script cannot see that a launch failed. `scripts/run`
uses this module: python3 -m drone_mesh.ros.graph.launching [what roslaunch accepts ...]
"""

from __future__ import annotations

import sys
from typing import ClassVar

import roslaunch
import roslaunch.parent
from roslaunch.pmon import ProcessListener, ProcessMonitor

EXIT_FAILED = 1


class FailedNodes(ProcessListener):
    """Collects the required nodes that end with an error. The monitor's thread calls it."""

    def __init__(self, monitor: ProcessMonitor) -> None:
        self._monitor = monitor
        self.names: list[str] = []

    def process_died(self, process_name: str, exit_code: int | None) -> None:
        """Called for a process that ends by itself; not for those that roslaunch stops."""
        process = self._monitor.get_process(process_name)
        if exit_code and process is not None and process.required:
            self.names.append(process_name)


class WatchedLaunch(roslaunch.parent.ROSLaunchParent):
    """A launch that records which required nodes failed."""

    failed: ClassVar[FailedNodes | None] = None  # of the one launch of this process

    def _start_infrastructure(self) -> None:
        # The constructor's listeners are added only after all nodes have started, too late for a
        # node that fails at once.
        super()._start_infrastructure()
        WatchedLaunch.failed = FailedNodes(self.pm)
        self.pm.add_process_listener(WatchedLaunch.failed)


def main() -> None:
    """Launch, and exit with 1 if a required node failed."""
    roslaunch.parent.ROSLaunchParent = WatchedLaunch  # type: ignore[misc]
    roslaunch.main(["roslaunch", *sys.argv[1:]])
    if WatchedLaunch.failed is not None and WatchedLaunch.failed.names:
        sys.exit(EXIT_FAILED)


if __name__ == "__main__":
    main()
