"""PacedHosts: how far the nodes have worked, in this process and in others."""

from __future__ import annotations

import logging
import math
import time
from typing import Protocol

import rospy
from std_msgs.msg import Header

from drone_mesh.ros.graph import names
from drone_mesh.ros.graph.logs import ThrottledLog

MAX_LAG_S = 0.03  # our choice: timers may fire at most 50 ms of simulated time late
HOST_TIMEOUT_S = 2.0  # wall seconds; the world goes on without a host that is silent for longer
LOOK_AGAIN_AFTER_S = 1.0  # wall seconds; between two looks at whether a stranger is a host

_log = logging.getLogger(__name__)


class PacedNodes(Protocol):
    """Nodes that live in the time of the world."""

    def lag_s(self, now_s: float) -> float:
        """For how many simulated seconds the oldest undone work has been waiting."""

    def time_advanced(self) -> None:
        """The world has made a step."""


class PacedHosts:
    """The nodes of this process, and hosts in other processes.

    Subscribes: /mesh/progress (Header), of processes that have declared themselves hosts

    Threads of rospy fill `_progress` and `_strangers`; all else belongs to the world's thread.
    """

    def __init__(self, nodes: PacedNodes | None) -> None:
        """`nodes` are those of this process, if there are any."""
        self._nodes = nodes
        # Host -> (simulated, monotonic) seconds of its latest report.
        self._progress: dict[str, tuple[float, float]] = {}
        self._strangers: dict[str, float] = {}  # node -> monotonic seconds of the last look at it
        self._complaints = ThrottledLog(_log)
        self._held_up_since_s = math.inf  # monotonic
        rospy.Subscriber(names.PROGRESS_TOPIC, Header, self._reported, tcp_nodelay=True)

    def are_behind(self, now_s: float) -> bool:
        """Whether undone work has been waiting too long for another step of the world."""
        slowest, lag_s = "", 0.0 if self._nodes is None else self._nodes.lag_s(now_s)
        for host, (done_s, reported_s) in list(self._progress.items()):
            if time.monotonic() - reported_s > HOST_TIMEOUT_S:
                _log.warning("host %s is silent; the world continues without it", host)
                del self._progress[host]
            elif now_s - done_s > lag_s:
                slowest, lag_s = host, now_s - done_s
        if lag_s <= MAX_LAG_S:
            self._held_up_since_s = math.inf
            return False
        self._held_up_since_s = min(self._held_up_since_s, time.monotonic())
        if time.monotonic() - self._held_up_since_s > HOST_TIMEOUT_S:
            waiting_for = f"host {slowest}" if slowest else "the nodes of this process"
            self._complaints.warning(
                "time stands still", f"waiting for {waiting_for}, {lag_s:.2f} s behind"
            )
        return True

    def time_advanced(self) -> None:
        """The world has made a step."""
        if self._nodes is not None:
            self._nodes.time_advanced()

    def _reported(self, progress: Header) -> None:
        reporter = progress._connection_header["callerid"]
        if reporter not in self._progress and not self._is_host(reporter):
            self._complaints.warning("progress ignored", f"{reporter} is not a host of nodes")
            return
        before_s, _reported_s = self._progress.get(reporter, (0.0, 0.0))
        # Two threads of a host report: the later report may know less.
        done_s = max(before_s, progress.stamp.to_sec())
        self._progress[reporter] = (done_s, time.monotonic())

    def _is_host(self, reporter: str) -> bool:
        """Whether it has declared itself a host; the master is not asked for each message."""
        now_s = time.monotonic()
        if now_s - self._strangers.get(reporter, -math.inf) < LOOK_AGAIN_AFTER_S:
            return False
        if rospy.has_param(names.host_param(reporter)):
            self._strangers.pop(reporter, None)
            return True
        self._strangers[reporter] = now_s
        return False
