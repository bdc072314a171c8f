"""RestingClock: follows /clock without a look at each tick."""

from __future__ import annotations

import time

import rospy
from rosgraph_msgs.msg import Clock

from drone_mesh.ros.graph import names

FIRST_REST_S = 0.01  # wall; the speed is not known yet
REST_S = 0.05  # wall, at most
COARSE_S = 0.05  # simulated; half of what the clocks of two processes may differ by


class RestingClock:
    """Lets rospy read several ticks of /clock at once, of which it keeps the newest.

    A tick that rospy reads by itself costs 0.3 ms: 3 % of a processor in each process at real time.
    For processes whose work does not begin with a tick.

    Subscribes: /clock (Clock). The thread of rospy that reads it owns everything, and rests in it.
    """

    def __init__(self) -> None:
        self._now_s = 0.0
        self._rest_s = FIRST_REST_S
        self._ticks = rospy.Subscriber(names.CLOCK_TOPIC, Clock, self._rest, queue_size=1)

    def stop(self) -> None:
        """Rest no more."""
        self._ticks.unregister()

    def _rest(self, tick: Clock) -> None:
        before_s, self._now_s = self._now_s, tick.clock.to_sec()
        if self._now_s > before_s:
            self._rest_s = min(REST_S, self._rest_s * COARSE_S / (self._now_s - before_s))
        time.sleep(self._rest_s)
