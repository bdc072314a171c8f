"""The node mesh_host: virtual Raspberry Pis apart from the world, perhaps on another machine."""

from __future__ import annotations

import logging
import time
from functools import partial
from typing import Callable

import rospy
from rosgraph_msgs.msg import Clock
from std_msgs.msg import Header

from drone_mesh.configuration import FactoryConfiguration
from drone_mesh.errors import ConfigurationError
from drone_mesh.execution import MeshExecutor
from drone_mesh.ros.graph import names
from drone_mesh.ros.graph.command_line import prepare_node
from drone_mesh.ros.graph.conversions import ros_time
from drone_mesh.ros.graph.logs import show_library_logs_on_rosout
from drone_mesh.ros.graph.orderly_stop import OrderlyStop
from drone_mesh.ros.graph.parameters import or_stop
from drone_mesh.ros.graph.persistent_service import PersistentService, ServiceGone
from drone_mesh.ros.host.fleet import fleet_from_parameter, mesh_settings
from drone_mesh.ros.host.mesh_host import MeshHost
from drone_mesh.srv import PowerSwitch

LOOK_PERIOD_S = 0.1  # wall; our choice
TELL_PERIOD_S = 5.0  # wall; while there is nothing to do but wait
PROGRESS_PERIOD_S = 0.5  # wall; the world gives up a host that is silent for two seconds

_log = logging.getLogger(__name__)


class FollowedClock:
    """Simulated time as /clock tells it, and what the world is told of how far the work is.

    `now_s` is set by rospy's thread and read by all.
    """

    def __init__(self) -> None:
        self.now_s = 0.0
        self._executor: MeshExecutor | None = None
        self._progress = rospy.Publisher(
            names.PROGRESS_TOPIC, Header, tcp_nodelay=True, queue_size=100
        )
        rospy.Subscriber(names.CLOCK_TOPIC, Clock, self._advance, tcp_nodelay=True)

    def drive(self, executor: MeshExecutor) -> None:
        """Let this executor know of the time, and the world of what it has worked off."""
        self._executor = executor

    def is_followed(self) -> bool:
        """Whether the world listens to how far the work is."""
        return self._progress.get_num_connections() > 0

    def tell_progress(self) -> None:
        """Say how far the work is; also while one piece of it takes long, or time stands still."""
        assert self._executor is not None
        now_s = self.now_s
        self._publish(ros_time(now_s - self._executor.lag_s(now_s)))

    def _advance(self, clock: Clock) -> None:
        self.now_s = clock.clock.to_sec()
        if self._executor is not None:
            self._executor.time_advanced()
            # Comes after everything that was due by now, or was submitted before.
            self._executor.submit(lambda _now_s: self._publish(clock.clock))

    def _publish(self, done: rospy.Time) -> None:
        self._progress.publish(Header(stamp=done, frame_id=rospy.get_name()))


def _wait_for(what: str, is_there: Callable[[], bool], give_up: Callable[[], bool]) -> None:
    told_s = time.monotonic()
    while not is_there() and not give_up():
        if time.monotonic() - told_s >= TELL_PERIOD_S:
            told_s = time.monotonic()
            _log.info("waiting for %s", what)
        time.sleep(LOOK_PERIOD_S)


def _whole_parameter(name: str) -> int:
    value = rospy.get_param(f"~{name}", "")
    try:
        return int(value)
    except ValueError:
        raise ConfigurationError(f"{name} is {value!r}, want a whole number") from None


def _is_served(node_id: int) -> bool:
    switch = PersistentService(names.power_switch(node_id), PowerSwitch)
    try:
        switch.connect()
    except ServiceGone:
        return False
    switch.close()
    return True


def ids_to_serve(fleet: FactoryConfiguration) -> range:
    """The ids that the parameters ask for: ~first..~last, or share ~index of ~hosts equal ones.

    Raises ConfigurationError for ids that the world has not made or somebody serves already.
    """
    count = fleet.gateways + fleet.routers
    if rospy.has_param("~hosts"):
        hosts, index = _whole_parameter("hosts"), _whole_parameter("index")
        if not 1 <= index <= hosts:
            raise ConfigurationError(f"index is {index}, want 1..hosts, and hosts is {hosts}")
        ids = range(count * (index - 1) // hosts, count * index // hosts)
    else:
        ids = range(_whole_parameter("first"), _whole_parameter("last") + 1)
        if len(ids) == 0 or ids[0] < 0 or ids[-1] >= count:
            raise ConfigurationError(
                f"first..last is {ids.start}..{ids.stop - 1}; the world has drones 0..{count - 1}"
            )
    served = [node_id for node_id in ids if _is_served(node_id)]
    if served:
        raise ConfigurationError(f"node {served[0]} is already served by another process")
    return ids


def main() -> None:
    """Virtual Raspberry Pis apart from the world, perhaps on another machine.

    Parameters (private): ~first and ~last (int): the ids to serve; or ~index and ~hosts (int):
    share number ~index (from 1) of ~hosts equal shares of all drones.
    """
    prepare_node(main.__doc__)
    rospy.init_node("mesh_host", disable_signals=True)
    show_library_logs_on_rosout()
    with OrderlyStop() as stop:
        clock = FollowedClock()
        fleet_is_there = partial(rospy.has_param, names.FLEET_PARAM)
        _wait_for("/DroneFactory to make the drones", fleet_is_there, stop.requested)
        _wait_for("/clock", lambda: clock.now_s > 0.0, stop.requested)
        if stop.requested():
            return
        fleet = fleet_from_parameter()
        ids = or_stop(lambda: ids_to_serve(fleet))
        which = f"{ids.start}..{ids.stop - 1}" if ids else "none"
        _log.info("serving %d drones: %s", len(ids), which)
        host = MeshHost(or_stop(lambda: mesh_settings(fleet)), lambda: clock.now_s)
        clock.drive(host.executor)
        host.start()
        try:
            host.wait_for_simulator(stop.requested)
            # Or time would go on while the nodes are started, and their timers would be late.
            _wait_for("/DroneFactory to listen", clock.is_followed, stop.requested)
            clock.tell_progress()
            host.serve(ids)
            while not stop.wait(PROGRESS_PERIOD_S):
                clock.tell_progress()
        finally:
            host.stop()
