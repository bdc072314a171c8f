"""WorldRunner: steps the world, publishes /clock, and keeps world and mesh in step."""

from __future__ import annotations

import logging
import math
import threading
import time
from collections import deque
from concurrent.futures import Future, TimeoutError
from typing import Any, Callable, NamedTuple, TypeVar

import rospy
from rosgraph_msgs.msg import Clock
from std_msgs.msg import Float32

from drone_mesh.configuration import MAX_REAL_TIME_FACTOR, MIN_REAL_TIME_FACTOR
from drone_mesh.errors import FleetRefused
from drone_mesh.msg import HostProgress
from drone_mesh.ros.graph import names
from drone_mesh.ros.graph.conversions import ros_time
from drone_mesh.ros.graph.direct_publisher import DirectPublisher
from drone_mesh.ros.graph.logs import ThrottledLog
from drone_mesh.ros.graph.simulation import Run, is_left_behind, run_headers
from drone_mesh.ros.host.mesh_host import MeshHost
from drone_mesh.srv import SetSpeed, SetSpeedRequest, SetSpeedResponse
from drone_mesh.world.pace import Pace, UnderWay
from drone_mesh.world.worlds import World

# Wall: the kernel buffers minutes of /clock for a subscriber before a send blocks.
STUCK_SUBSCRIBER_S = 0.02
_MEASURE_PERIOD_S = 1.0  # wall
_TOO_SLOW = 0.95  # of the requested factor
_NAP_S = 0.001  # wall; while the mesh processes what is due
_TASK_POLL_S = 0.2  # wall; how soon a waiting caller notices the end of the simulation
_SHORTEST_NAP_S = 0.005  # wall; steps that become due meanwhile need one wake-up together
_LONGEST_NAP_S = 0.05  # wall; a new speed or Ctrl-C takes effect after this at the latest

# Simulated: a timer is late by at most this plus one step of the world, and so is the last
# consequence of an event. The mesh waits more than ten times as long for an answer.
MAX_LAG_S = 0.03
HOST_TIMEOUT_S = 2.0  # wall seconds; the world continues without a host that is silent for longer
ASK_AGAIN_AFTER_S = 1.0  # wall seconds; between two checks whether a stranger is a host

_log = logging.getLogger(__name__)

Result = TypeVar("Result")


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
            self._throttled_log.note(
                "time stands still", f"waiting for {slowest}, {now_s - self._quiet_s:.2f} s behind"
            )
        return True

    def others(self) -> list[str]:
        """The hosts in other processes that send reports. Any thread."""
        return list(self._progress)

    def _reported(self, progress: HostProgress) -> None:
        if is_left_behind(progress, self._run):  # a host that has not noticed this world yet
            return
        reporter = progress._connection_header["callerid"]
        if reporter not in self._progress and not self._is_host(reporter):
            self._throttled_log.note("progress ignored", f"{reporter} is not a host of nodes")
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
        self._nodes = nodes
        self._hosts = PacedHosts(run, nodes)
        self.hosts = self._hosts.others
        self.paused = False  # this and the next: read by any thread
        self.wanted_factor = factor  # simulated seconds per wall second; 0: as fast as possible
        self._tasks: deque[tuple[Callable[[], Any], Future[Any]]] = deque()
        self._over = threading.Event()
        self._clock = DirectPublisher(
            names.CLOCK_TOPIC, Clock, STUCK_SUBSCRIBER_S, run_headers(run)
        )
        self._tick = Clock()  # one for all, as a new one takes a tenth of the time of a step
        self._factor = rospy.Publisher(names.FACTOR_TOPIC, Float32, latch=True, queue_size=1)
        rospy.Service(names.SPEED_SERVICE, SetSpeed, self._set_speed)

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
        pace = Pace(self.wanted_factor)
        begun = self._world.now_s, time.monotonic()
        try:
            while not is_over():
                self._run_tasks()
                self._step_when_due(pace)
                now = self._world.now_s, time.monotonic()
                if now[1] - begun[1] >= _MEASURE_PERIOD_S:
                    self._factor.publish((now[0] - begun[0]) / (now[1] - begun[1]))
                    self._log_factor(pace, *now)
                    begun = now
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
                time.sleep(max(wait_s, _SHORTEST_NAP_S))
            self._tick.clock = ros_time(self._world.step())
            self._clock.publish(self._tick)
            if self._nodes is not None:
                self._nodes.executor.time_advanced()

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
