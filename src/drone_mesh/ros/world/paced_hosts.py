"""PacedHosts: how far the nodes have worked, in this process and in others."""

from __future__ import annotations

import logging
import time
from typing import Protocol

import rospy
from std_msgs.msg import Header

from drone_mesh.ros.graph import names

HOST_TIMEOUT_S = 2.0  # wall seconds; the world goes on without a host that is silent for longer

_log = logging.getLogger(__name__)


class PacedNodes(Protocol):
    """Nodes that live in the time of the world."""

    def lag_s(self, now_s: float) -> float:
        """For how many simulated seconds the oldest undone work has been waiting."""

    def time_advanced(self) -> None:
        """The world has made a step."""


class PacedHosts:
    """The nodes of this process, and hosts in other processes.

    Subscribes: /mesh/progress (Header)

    Threads of rospy fill `_progress`; everything else belongs to the world's thread.
    """

    def __init__(self, nodes: PacedNodes | None) -> None:
        """`nodes` are those of this process, if there are any."""
        self._nodes = nodes
        # Host -> (simulated, monotonic) seconds of its latest report.
        self._progress: dict[str, tuple[float, float]] = {}
        rospy.Subscriber(names.PROGRESS_TOPIC, Header, self._reported, tcp_nodelay=True)

    def lag_s(self, now_s: float) -> float:
        """For how many simulated seconds the oldest undone work has been waiting."""
        lag_s = 0.0 if self._nodes is None else self._nodes.lag_s(now_s)
        for host, (done_s, reported_s) in list(self._progress.items()):
            if time.monotonic() - reported_s > HOST_TIMEOUT_S:
                _log.warning("host %s is silent; the world continues without it", host)
                del self._progress[host]
            else:
                lag_s = max(lag_s, now_s - done_s)
        return lag_s

    def time_advanced(self) -> None:
        """The world has made a step."""
        if self._nodes is not None:
            self._nodes.time_advanced()

    def _reported(self, progress: Header) -> None:
        before_s, _reported_s = self._progress.get(progress.frame_id, (0.0, 0.0))
        # Two threads of a host report: the later report may know less.
        done_s = max(before_s, progress.stamp.to_sec())
        self._progress[progress.frame_id] = (done_s, time.monotonic())
