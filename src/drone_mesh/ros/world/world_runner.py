"""WorldRunner: steps the world, publishes /clock, and keeps world and mesh in step."""

from __future__ import annotations

import logging
import threading
import time
from collections import deque
from concurrent.futures import Future, TimeoutError
from typing import Any, Callable, TypeVar

import rospy
from rosgraph_msgs.msg import Clock
from std_msgs.msg import Float32

from drone_mesh.configuration import MAX_REAL_TIME_FACTOR, MIN_REAL_TIME_FACTOR
from drone_mesh.errors import FleetRefused
from drone_mesh.ros.graph import names
from drone_mesh.ros.graph.conversions import ros_time
from drone_mesh.ros.graph.direct_publisher import DirectPublisher
from drone_mesh.ros.graph.run import Run, run_headers
from drone_mesh.ros.host.mesh_host import MeshHost
from drone_mesh.ros.world.paced_hosts import PacedHosts
from drone_mesh.srv import SetSpeed, SetSpeedRequest, SetSpeedResponse
from drone_mesh.world.interfaces import World
from drone_mesh.world.pace import Pace

# Wall: the kernel buffers minutes of /clock for a subscriber before a send blocks.
STUCK_SUBSCRIBER_S = 0.02
_MEASURE_PERIOD_S = 1.0  # wall
_TOO_SLOW = 0.95  # of the requested factor
_NAP_S = 0.001  # wall; while the mesh processes what is due
_TASK_POLL_S = 0.2  # wall; how soon a waiting caller notices the end of the simulation
_LONGEST_NAP_S = 0.05  # wall; a new speed or Ctrl-C takes effect after this at the latest

_log = logging.getLogger(__name__)

Result = TypeVar("Result")


class WorldRunner:
    """Steps a world in the thread that calls `run`.

    Publishes: /clock (Clock) at 100 Hz of simulated time; /DroneFactory/real_time_factor (Float32),
               the achieved factor, once a second. Subscribes: /mesh/progress (HostProgress).
    Services:  /DroneFactory/setSpeed (SetSpeed)

    The world never runs ahead of pending work of the nodes: when the machine is too slow, simulated
    time slows down, and no timer is late. Threads of rospy set `paused` and `wanted_factor`.
    """

    def __init__(self, world: World, run: Run, factor: float, nodes: MeshHost | None) -> None:
        """`run` is the world's. `nodes` are those of this process, or None."""
        self._world = world
        self._hosts = PacedHosts(run, nodes)
        self.paused = False  # this and the next: read by any thread
        self.wanted_factor = factor  # simulated seconds per wall second; 0: as fast as possible
        self._tasks: deque[tuple[Callable[[], Any], Future[Any]]] = deque()
        self._over = threading.Event()
        self._clock = DirectPublisher(
            names.CLOCK_TOPIC, Clock, STUCK_SUBSCRIBER_S, run_headers(run)
        )
        self._factor = rospy.Publisher(names.FACTOR_TOPIC, Float32, latch=True, queue_size=1)
        rospy.Service(names.SPEED_SERVICE, SetSpeed, self._set_speed)

    def hosts(self) -> list[str]:
        """The ROS nodes that run nodes of the mesh outside this process. Any thread."""
        return self._hosts.others()

    def between_steps(self, function: Callable[[], Result]) -> Result:
        """Call `function` in the thread of `run`; returns its result. Any other thread.

        Raises what `function` raises, and FleetRefused if the simulation ends first.
        """
        future: Future[Result] = Future()
        self._tasks.append((function, future))
        while True:
            try:
                return future.result(_TASK_POLL_S)
            except TimeoutError:
                if self._over.is_set():
                    raise FleetRefused("the simulation ends") from None

    def run(self, is_over: Callable[[], bool]) -> None:
        """Step until `is_over` returns True."""
        pace = Pace(self.wanted_factor)
        measured_s = self._world.now_s, time.monotonic()
        try:
            while not is_over():
                self._run_tasks()
                self._step_when_due(pace)
                if time.monotonic() - measured_s[1] >= _MEASURE_PERIOD_S:
                    measured_s = self._measure(measured_s)
                    self._log_factor(pace, *measured_s)
        finally:
            self._over.set()

    def _run_tasks(self) -> None:
        while self._tasks:
            function, future = self._tasks.popleft()
            try:
                future.set_result(function())
            except Exception as error:  # passed to the waiting thread
                future.set_exception(error)

    def _step_when_due(self, pace: Pace) -> None:
        """Make a step, or sleep briefly if none is due."""
        now_s = self._world.now_s
        if self.paused or self.wanted_factor != pace.factor:
            pace.restart(self.wanted_factor)
        if self.paused:
            time.sleep(_LONGEST_NAP_S)
        elif self._hosts.are_behind(now_s):
            time.sleep(_NAP_S)
        else:
            wait_s = pace.wait_s(now_s, time.monotonic())
            if wait_s > _LONGEST_NAP_S:
                time.sleep(_LONGEST_NAP_S)
                return
            if wait_s > 0.0:
                time.sleep(wait_s)
            self._clock.publish(Clock(ros_time(self._world.step())))
            self._hosts.time_advanced()

    def _measure(self, before_s: tuple[float, float]) -> tuple[float, float]:
        """Publish the factor since `before_s` (simulated, wall); returns the current times."""
        now_s = self._world.now_s, time.monotonic()
        self._factor.publish((now_s[0] - before_s[0]) / (now_s[1] - before_s[1]))
        return now_s

    def _log_factor(self, pace: Pace, simulated_s: float, wall_s: float) -> None:
        achieved = pace.achieved(simulated_s, wall_s)
        if achieved is None:
            return
        if pace.factor == 0.0:
            _log.info("real-time factor %.1f", achieved)
        elif achieved < _TOO_SLOW * pace.factor:
            _log.warning("real-time factor %.2f instead of %g", achieved, pace.factor)

    def _set_speed(self, request: SetSpeedRequest) -> SetSpeedResponse:
        factor = request.real_time_factor
        if factor != 0.0 and not MIN_REAL_TIME_FACTOR <= factor <= MAX_REAL_TIME_FACTOR:
            return SetSpeedResponse(
                False,
                f"invalid real_time_factor {factor:g}: must be {MIN_REAL_TIME_FACTOR:g}.."
                f"{MAX_REAL_TIME_FACTOR:g}, or 0 to keep it",
            )
        self.paused = request.paused
        if factor > 0.0:
            self.wanted_factor = factor
        return SetSpeedResponse(True, "")
