"""FollowedClock: the world's time in another process, and the progress of that process."""

from __future__ import annotations

from typing import Callable

import rospy
from rosgraph_msgs.msg import Clock

from drone_mesh.msg import HostProgress
from drone_mesh.ros.graph import names
from drone_mesh.ros.graph.conversions import ros_time
from drone_mesh.ros.graph.run import Run, run_headers, run_of
from drone_mesh.ros.host.mesh_host import MeshHost

_QUEUE = 100


class FollowedClock:
    """Follows /clock, and reports the progress of this process to the world.

    Subscribes: /clock (Clock)
    Publishes:  /mesh/progress (HostProgress)

    `now_s` and `run` are set by rospy's thread and read by any; `_reported` is set by the
    executor's worker.
    """

    def __init__(self, on_other_run: Callable[[], None]) -> None:
        """`on_other_run` is called, by rospy's thread, if the world that a host follows is over."""
        self.run: Run = ""
        self.now_s = 0.0
        self._on_other_run = on_other_run
        self._host: MeshHost | None = None
        self._reported = 0  # packets under way in the last report
        rospy.Subscriber(names.CLOCK_TOPIC, Clock, self._advance, tcp_nodelay=True)

    def drive(self, host: MeshHost, run: Run) -> None:
        """Advance this host with the clock of this run, and report its progress from now on."""
        self._progress = rospy.Publisher(
            names.PROGRESS_TOPIC,
            HostProgress,
            headers=run_headers(run),
            tcp_nodelay=True,
            queue_size=_QUEUE,
        )
        self.run = run
        self._host = host
        host.executor.when_idle(self._idle)

    def is_followed(self) -> bool:
        """Whether the world subscribes to the reports."""
        return self._progress.get_num_connections() > 0

    def report_progress(self) -> None:
        """Report now, even during long work or while time stands still."""
        assert self._host is not None
        now_s = self.now_s
        self._publish(ros_time(now_s - self._host.lag_s(now_s)))

    def _advance(self, clock: Clock) -> None:
        run = run_of(clock)
        if self._host is None:
            self.run = run
            self.now_s = clock.clock.to_sec()
        elif run == self.run:
            self.now_s = clock.clock.to_sec()
            self._host.time_advanced()
            # Runs after all work that was due or submitted before.
            self._host.executor.submit(lambda _now_s: self._publish(clock.clock))
        elif run:  # time began again, and the nodes would wait until it is as late as before
            self._on_other_run()

    def _idle(self) -> None:
        """Called when the worker has no work left, for which the world may be waiting."""
        assert self._host is not None
        if self._host.under_way != self._reported:
            self._publish(ros_time(self.now_s))

    def _publish(self, done: rospy.Time) -> None:
        assert self._host is not None
        self._reported = self._host.under_way
        self._progress.publish(HostProgress(rospy.get_name(), done, self._reported))
