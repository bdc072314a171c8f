"""The node mesh_host: virtual Raspberry Pis in a process other than the world's."""

from __future__ import annotations

import contextlib
import logging
from functools import partial
from typing import Callable, Collection

import rospy
from rosgraph_msgs.msg import Clock
from std_msgs.msg import String

from drone_mesh.air.obstacles import Obstacles
from drone_mesh.arguments import is_whole
from drone_mesh.configuration import FactoryConfiguration
from drone_mesh.drone.fleet import ids_in_words
from drone_mesh.drone.roles import Role
from drone_mesh.errors import ConfigurationError
from drone_mesh.msg import HostProgress
from drone_mesh.ros.graph import names
from drone_mesh.ros.graph.command_line import start_node
from drone_mesh.ros.graph.conversions import ros_time
from drone_mesh.ros.graph.direct_publisher import DirectPublisher
from drone_mesh.ros.graph.fleet_parameter import (
    drones_if_known,
    get_fleet_parameter,
    get_present_drones,
)
from drone_mesh.ros.graph.logs import show_library_logs_on_rosout
from drone_mesh.ros.graph.master import NO_ANSWER, MasterWatch
from drone_mesh.ros.graph.orderly_stop import OrderlyStop
from drone_mesh.ros.graph.parameters import configured_obstacles, or_exit, told_fence
from drone_mesh.ros.graph.simulation import PresentDrones, Run, run_headers, run_of
from drone_mesh.ros.graph.waiting import comes_true
from drone_mesh.ros.host.engines import ReportedPlaces
from drone_mesh.ros.host.mesh_host import MeshHost
from drone_mesh.ros.host.radios import node_runs
from drone_mesh.ros.host.virtual_raspberry_pi import MeshSettings

WAITING_LOG_PERIOD_S = 5.0  # wall; between two log lines about what is being waited for
PROGRESS_PERIOD_S = 0.5  # wall; the world continues without a host that is silent for two seconds
STUCK_WORLD_S = 0.5  # wall; the kernel buffers minutes of reports before a send blocks

_log = logging.getLogger(__name__)


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
        self._progress = DirectPublisher(
            names.PROGRESS_TOPIC, HostProgress, STUCK_WORLD_S, run_headers(run)
        )
        self.run = run
        self._host = host
        host.executor.when_idle(self._idle)

    def is_followed(self) -> bool:
        """Whether the world subscribes to the reports."""
        return self._progress.has_subscriber()

    def report_progress(self) -> None:
        """Report now, even during long work or while time stands still."""
        assert self._host is not None
        self._publish(ros_time(self.now_s - self._host.lag_s(self.now_s)))

    def _advance(self, clock: Clock) -> None:
        run = run_of(clock)
        if self._host is None:
            self.run = run
            self.now_s = clock.clock.to_sec()
        elif run == self.run:
            self.now_s = clock.clock.to_sec()
            self._host.executor.time_advanced()
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


def _wait_for(what: str, is_there: Callable[[], bool], give_up: Callable[[], bool]) -> None:
    while not (comes_true(is_there, WAITING_LOG_PERIOD_S, give_up) or give_up()):
        _log.info("waiting for %s", what)


def _whole_parameter(name: str) -> int:
    value = str(rospy.get_param(f"~{name}", ""))
    if not is_whole(value):
        raise ConfigurationError(f"invalid {name} {value!r}: must be a whole number")
    return int(value)


def _obstacles_of(fleet: FactoryConfiguration) -> Obstacles | None:
    """The boxes of the world; None, with a warning, if this machine does not have their file."""
    try:
        return configured_obstacles(fleet)
    except ConfigurationError as error:
        _log.warning("%s; only the world refuses orders into obstacles, these nodes do not", error)
        return None


def share_of_host(fleet: FactoryConfiguration, drones: PresentDrones) -> range:
    """The ids that the parameters select: ~first..~last, or part ~index of ~hosts equal parts.

    The parts divide the drones present at the start. Raises ConfigurationError for ids that the
    world does not have or another process hosts.
    """
    count = fleet.gateways + fleet.routers
    if rospy.has_param("~hosts"):
        hosts, index = _whole_parameter("hosts"), _whole_parameter("index")
        if not 1 <= index <= hosts:
            raise ConfigurationError(
                f"invalid index {index}: must be 1..{hosts} (the number of hosts)"
            )
        ids = range(count * (index - 1) // hosts, count * index // hosts)
    else:
        ids = range(_whole_parameter("first"), _whole_parameter("last") + 1)
        if len(ids) == 0 or not drones.roles.keys() >= set(ids):
            raise ConfigurationError(
                f"invalid first..last {ids.start}..{ids.stop - 1}: the drones are "
                f"{ids_in_words(drones.roles)}"
            )
    served = [n for n in drones.of_host(rospy.get_name(), ids) if node_runs(n)]
    if served:
        raise ConfigurationError(f"node {served[0]} is already hosted by another process")
    return ids


def _follow(host: MeshHost, share: Collection[int], served: dict[int, Role]) -> dict[int, Role]:
    """Start and end nodes so that the host runs its share of /drone_mesh/drones; returns them.

    `share`: ids of the drones that this host runs unless another host does. `served`: what it runs.
    """
    drones = None
    with contextlib.suppress(*NO_ANSWER):  # the master is ending or has just started
        drones = drones_if_known()
    if drones is None:
        return served
    wanted = drones.of_host(rospy.get_name(), share)
    for node_id in served.keys() - wanted.keys():
        host.end_node(node_id)
    host.start_nodes({n: role for n, role in wanted.items() if n not in served})
    return wanted


def main() -> None:
    """Runs the nodes of some drones outside the world's process, also on another machine.

    Parameters (private): either ~first and ~last (int), the ids of the drones; or ~hosts and
    ~index (int): the drones are divided into ~hosts equal parts, and this program runs the nodes
    of part ~index, 1..~hosts.
    """
    start_node(main.__doc__, "mesh_host", disable_signals=True, every_tick=True)
    show_library_logs_on_rosout()
    with OrderlyStop() as stop:
        clock = FollowedClock(stop.begin_anew)
        fleet_is_there = partial(rospy.has_param, names.FLEET_PARAM)
        _wait_for("DroneFactory to create the drones", fleet_is_there, stop.requested)
        _wait_for("its clock", lambda: clock.now_s > 0.0, stop.requested)
        if stop.requested():
            return
        run = clock.run
        fleet = get_fleet_parameter()
        ids = or_exit(lambda: share_of_host(fleet, get_present_drones()))
        _log.info("serving %s", f"drones {ids.start}..{ids.stop - 1}" if ids else "no drones")
        settings = or_exit(
            lambda: MeshSettings.from_configuration(fleet, run, _obstacles_of(fleet))
        )
        places = ReportedPlaces()
        host = MeshHost(settings, lambda: clock.now_s, stop.fail, places.place_of)

        def keep_to(told: String) -> None:
            fence = told_fence(told)
            if fence is not None:
                host.keep_to(fence)

        rospy.Subscriber(names.FENCE_TOPIC, String, keep_to)
        # The world waits for declared hosts only.
        rospy.set_param(names.host_param(rospy.get_name()), [ids.start, ids.stop - 1])
        MasterWatch(names.host_param(rospy.get_name())).start()
        clock.drive(host, run)
        host.start()
        try:
            host.wait_for_radios(stop.requested)
            # Otherwise time would advance while the nodes start, and their timers would be late.
            _wait_for(
                "DroneFactory to subscribe to the progress", clock.is_followed, stop.requested
            )
            clock.report_progress()
            served = _follow(host, ids, {})
            while not stop.wait(PROGRESS_PERIOD_S):
                clock.report_progress()
                served = _follow(host, ids, served)
        finally:
            host.stop()
