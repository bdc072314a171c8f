"""WorldRunner: steps the world, publishes /clock, and keeps world and mesh together."""

from __future__ import annotations

import logging
import math
import time
from typing import Callable, Protocol

import rospy
from rosgraph_msgs.msg import Clock
from std_msgs.msg import Float32, Header

from drone_mesh.ros.graph import names
from drone_mesh.ros.graph.conversions import ros_time
from drone_mesh.srv import SetSpeed, SetSpeedRequest, SetSpeedResponse
from drone_mesh.world.interfaces import World
from drone_mesh.world.pace import Pace

MAX_LAG_S = 0.03  # our choice: timers may fire at most 50 ms of simulated time late
HOST_TIMEOUT_S = 2.0  # wall seconds; a host that is silent for longer is not waited for
_MEASURE_PERIOD_S = 1.0  # wall
_TELL_PERIOD_S = 10.0  # wall
_TOO_SLOW = 0.95  # of the requested factor
_NAP_S = 0.001  # wall; while the nodes do work that is due
_PAUSE_NAP_S = 0.02

_log = logging.getLogger(__name__)


class PacedNodes(Protocol):
    """Nodes that use the time of the world."""

    def lag_s(self, now_s: float) -> float:
        """For how many simulated seconds the oldest undone work has been waiting."""

    def time_advanced(self) -> None:
        """The world has made a step."""


class _Hosts:
    """The progress of the nodes, in this process and in the hosts of others."""

    def __init__(self, nodes: PacedNodes | None) -> None:
        self._nodes = nodes
        # Host -> its last report: (simulated, monotonic) seconds. Filled by rospy's threads.
        self._progress: dict[str, tuple[float, float]] = {}
        rospy.Subscriber(names.PROGRESS_TOPIC, Header, self._heard, tcp_nodelay=True)

    def _heard(self, progress: Header) -> None:
        before_s, _said_s = self._progress.get(progress.frame_id, (0.0, 0.0))
        # Two threads of a host report; a later report may be an older one.
        done_s = max(before_s, progress.stamp.to_sec())
        self._progress[progress.frame_id] = (done_s, time.monotonic())

    def lag_s(self, now_s: float) -> float:
        """For how many simulated seconds the oldest undone work has been waiting."""
        lag_s = 0.0 if self._nodes is None else self._nodes.lag_s(now_s)
        for host, (done_s, said_s) in list(self._progress.items()):
            if time.monotonic() - said_s > HOST_TIMEOUT_S:
                _log.warning("host %s is silent; the world continues without it", host)
                del self._progress[host]
            else:
                lag_s = max(lag_s, now_s - done_s)
        return lag_s

    def time_advanced(self) -> None:
        if self._nodes is not None:
            self._nodes.time_advanced()


class WorldRunner:
    """Steps a world in the thread that calls `run`.

    Publishes: /clock (Clock) at 100 Hz of simulated time; /DroneFactory/real_time_factor (Float32),
               the factor reached, once a second. Subscribes: /mesh/progress (Header).
    Services:  /DroneFactory/setSpeed (SetSpeed)

    The world never runs ahead of the nodes' undone work: when the machine is too slow, simulated
    time slows down, and no timer is late. `_paused` and `_wanted` are set by rospy's threads.
    """

    def __init__(self, world: World, factor: float, nodes: PacedNodes | None) -> None:
        """`nodes` are those of this process, or None."""
        self._world = world
        self._hosts = _Hosts(nodes)
        self._paused = False
        self._wanted = factor
        self._clock = rospy.Publisher(names.CLOCK_TOPIC, Clock, tcp_nodelay=True, queue_size=100)
        self._factor = rospy.Publisher(names.FACTOR_TOPIC, Float32, latch=True, queue_size=1)
        rospy.Service(names.SPEED_SERVICE, SetSpeed, self._set_speed)

    @property
    def wanted_factor(self) -> float:
        """The requested simulated seconds per wall second; 0: as fast as possible. Any thread."""
        return self._wanted

    @property
    def paused(self) -> bool:
        """Whether simulated time is paused. Any thread."""
        return self._paused

    def run(self, is_over: Callable[[], bool]) -> None:
        """Step until `is_over` says so."""
        pace = Pace(self._wanted)
        measured_s = self._world.now_s, time.monotonic()
        told_s = measured_s
        while not is_over():
            now_s = self._world.now_s
            if self._paused or self._wanted != pace.factor:
                pace.restart(self._wanted)
            if self._paused:
                time.sleep(_PAUSE_NAP_S)
            elif self._hosts.lag_s(now_s) > MAX_LAG_S:
                time.sleep(_NAP_S)
            else:
                wait_s = pace.wait_s(now_s, time.monotonic())
                if wait_s > 0.0:
                    time.sleep(wait_s)
                self._step()
            if time.monotonic() - measured_s[1] >= _MEASURE_PERIOD_S:
                measured_s = self._measure(measured_s)
                if measured_s[1] - told_s[1] >= _TELL_PERIOD_S:
                    self._tell(told_s, measured_s)
                    told_s = measured_s

    def _step(self) -> None:
        now_s = self._world.step()
        self._clock.publish(Clock(ros_time(now_s)))
        self._hosts.time_advanced()

    def _measure(self, before_s: tuple[float, float]) -> tuple[float, float]:
        """Publish the factor since `before_s` (simulated, wall); returns the two times of now."""
        now_s = self._world.now_s, time.monotonic()
        self._factor.publish((now_s[0] - before_s[0]) / (now_s[1] - before_s[1]))
        return now_s

    def _tell(self, before_s: tuple[float, float], now_s: tuple[float, float]) -> None:
        reached = (now_s[0] - before_s[0]) / (now_s[1] - before_s[1])
        if self._paused:
            return
        if self._wanted == 0.0:
            _log.info("real-time factor %.1f", reached)
        elif reached < _TOO_SLOW * self._wanted:
            _log.warning("real-time factor %.2f, requested %g", reached, self._wanted)

    def _set_speed(self, request: SetSpeedRequest) -> SetSpeedResponse:
        factor = request.real_time_factor
        if not (math.isfinite(factor) and factor >= 0.0):
            return SetSpeedResponse(False, f"invalid real_time_factor {factor}: must be above 0")
        self._paused = request.paused
        if factor > 0.0:
            self._wanted = factor
        return SetSpeedResponse(True, "")
