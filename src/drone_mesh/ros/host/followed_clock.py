"""FollowedClock: the world's time in another process, and how far its work has followed."""

from __future__ import annotations

import rospy
from rosgraph_msgs.msg import Clock
from std_msgs.msg import Header

from drone_mesh.execution import MeshExecutor
from drone_mesh.ros.graph import names
from drone_mesh.ros.graph.conversions import ros_time

_QUEUE = 100


class FollowedClock:
    """Follows /clock, and reports to the world how far the work of this process is.

    Subscribes: /clock (Clock)
    Publishes:  /mesh/progress (Header: stamp = all work up to this simulated time is done)

    `now_s` is set by rospy's thread and read by all.
    """

    def __init__(self) -> None:
        self.now_s = 0.0
        self._executor: MeshExecutor | None = None
        self._progress = rospy.Publisher(
            names.PROGRESS_TOPIC, Header, tcp_nodelay=True, queue_size=_QUEUE
        )
        rospy.Subscriber(names.CLOCK_TOPIC, Clock, self._advance, tcp_nodelay=True)

    def drive(self, executor: MeshExecutor) -> None:
        """Move this executor with the clock, and report its work from now on."""
        self._executor = executor

    def is_followed(self) -> bool:
        """Whether the world subscribes to the reports."""
        return self._progress.get_num_connections() > 0

    def report_progress(self) -> None:
        """Report now; also while one piece of work takes long, or time stands still."""
        assert self._executor is not None
        now_s = self.now_s
        self._publish(ros_time(now_s - self._executor.lag_s(now_s)))

    def _advance(self, clock: Clock) -> None:
        self.now_s = clock.clock.to_sec()
        if self._executor is not None:
            self._executor.time_advanced()
            # Runs after everything that was due by now, or was submitted before.
            self._executor.submit(lambda _now_s: self._publish(clock.clock))

    def _publish(self, done: rospy.Time) -> None:
        self._progress.publish(Header(stamp=done, frame_id=rospy.get_name()))
