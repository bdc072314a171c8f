"""PacedHosts: the progress of the nodes, in this process and in others."""

from __future__ import annotations

import logging
import math
import time
from typing import NamedTuple

import rospy

from drone_mesh.msg import HostProgress
from drone_mesh.ros.graph import names
from drone_mesh.ros.graph.logs import ThrottledLog
from drone_mesh.ros.graph.run import Run, is_left_behind
from drone_mesh.ros.host.mesh_host import MeshHost
from drone_mesh.world.under_way import UnderWay

# Simulated: a timer is late by at most this plus one step of the world, and so is the last
# consequence of an event. The mesh waits more than ten times as long for an answer.
MAX_LAG_S = 0.03
HOST_TIMEOUT_S = 2.0  # wall seconds; the world continues without a host that is silent for longer
ASK_AGAIN_AFTER_S = 1.0  # wall seconds; between two checks whether a stranger is a host

_log = logging.getLogger(__name__)


class _Progress(NamedTuple):
    """The latest report of a host."""

    done_s: float  # simulated; all work up to then is done
    under_way: int  # packets handed over minus packets processed
    reported_s: float  # monotonic


class PacedHosts:
    """The nodes of this process, and hosts in other processes.

    The mesh is quiet when all hosts have done what was due and no packet is under way, in a queue
    or between processes. The world is never more than MAX_LAG_S ahead of the last quiet moment, so
    all consequences of an event, over any number of hops, happen within that time, however slow the
    machine is.

    Subscribes: /mesh/progress (HostProgress), of processes that have declared themselves hosts

    Threads of rospy fill `_progress` and `_strangers`; the world's thread owns everything else.
    """

    def __init__(self, run: Run, nodes: MeshHost | None) -> None:
        """`run` is the world's. `nodes` are those of this process, or None."""
        self._run = run
        self._nodes = nodes
        self._progress: dict[str, _Progress] = {}
        self._under_way = UnderWay()
        self._quiet_s = 0.0  # simulated
        self._strangers: dict[str, float] = {}  # node -> monotonic seconds of the last check
        self._throttled_log = ThrottledLog(_log)
        self._seen = (0.0, 0)  # work done and packets under way at the last call
        self._stuck_since_s = time.monotonic()  # time stands still, and no work is done
        rospy.Subscriber(names.PROGRESS_TOPIC, HostProgress, self._reported, tcp_nodelay=True)

    def are_behind(self, now_s: float) -> bool:
        """Whether the last quiet moment is too long ago for another step of the world."""
        wall_s = time.monotonic()
        slowest, done_s, under_way, idle = "the nodes of this process", now_s, 0, True
        if self._nodes is not None:
            idle = self._nodes.idle
            done_s, under_way = now_s - self._nodes.lag_s(now_s), self._nodes.under_way
        for host, progress in list(self._progress.items()):
            if wall_s - progress.reported_s > HOST_TIMEOUT_S:
                _log.warning("host %s is silent; the world continues without it", host)
                del self._progress[host]
                continue
            under_way += progress.under_way
            if progress.done_s < done_s:
                slowest, done_s = f"host {host}", progress.done_s
        if self._under_way.is_none(under_way, idle, wall_s):
            self._quiet_s = max(self._quiet_s, done_s)
        elif done_s >= now_s:
            slowest = f"{under_way} packets"
        if now_s - self._quiet_s <= MAX_LAG_S:
            self._stuck_since_s = wall_s
            return False
        if (done_s, under_way) != self._seen:
            self._seen, self._stuck_since_s = (done_s, under_way), wall_s
        if wall_s - self._stuck_since_s > HOST_TIMEOUT_S:
            self._throttled_log.warning(
                "time stands still", f"waiting for {slowest}, {now_s - self._quiet_s:.2f} s behind"
            )
        return True

    def others(self) -> list[str]:
        """The hosts in other processes that send reports. Any thread."""
        return list(self._progress)

    def time_advanced(self) -> None:
        """The world has made a step."""
        if self._nodes is not None:
            self._nodes.time_advanced()

    def _reported(self, progress: HostProgress) -> None:
        if is_left_behind(progress, self._run):  # a host that has not noticed this world yet
            return
        reporter = progress._connection_header["callerid"]
        if reporter not in self._progress and not self._is_host(reporter):
            self._throttled_log.warning("progress ignored", f"{reporter} is not a host of nodes")
            return
        before = self._progress.get(reporter)
        # Two threads of a host send reports, so a later report may show less progress.
        done_s = max(0.0 if before is None else before.done_s, progress.done.to_sec())
        self._progress[reporter] = _Progress(done_s, progress.under_way, time.monotonic())

    def _is_host(self, reporter: str) -> bool:
        """Whether it has declared itself a host; asks the master at most once a second."""
        now_s = time.monotonic()
        if now_s - self._strangers.get(reporter, -math.inf) < ASK_AGAIN_AFTER_S:
            return False
        if rospy.has_param(names.host_param(reporter)):
            self._strangers.pop(reporter, None)
            return True
        self._strangers[reporter] = now_s
        return False
