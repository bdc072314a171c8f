"""The node mesh_host: virtual Raspberry Pis apart from the world, perhaps on another machine."""

from __future__ import annotations

import logging
import time
from functools import partial
from typing import Callable

import rospy

from drone_mesh.air.obstacles import Obstacles
from drone_mesh.configuration import FactoryConfiguration
from drone_mesh.errors import ConfigurationError
from drone_mesh.ros.graph import names
from drone_mesh.ros.graph.command_line import prepare_node
from drone_mesh.ros.graph.fleet_parameter import get_fleet_parameter
from drone_mesh.ros.graph.logs import show_library_logs_on_rosout
from drone_mesh.ros.graph.master_watch import MasterWatch
from drone_mesh.ros.graph.orderly_stop import OrderlyStop
from drone_mesh.ros.graph.parameters import configured_obstacles, or_stop
from drone_mesh.ros.graph.persistent_service import PersistentService, ServiceGone
from drone_mesh.ros.host.followed_clock import FollowedClock
from drone_mesh.ros.host.mesh_host import MeshHost
from drone_mesh.ros.host.mesh_settings import MeshSettings
from drone_mesh.srv import PowerSwitch

LOOK_PERIOD_S = 0.1  # wall; our choice
WAITING_LOG_PERIOD_S = 5.0  # wall; between two log lines about what is being waited for
PROGRESS_PERIOD_S = 0.5  # wall; the world continues without a host that is silent for two seconds

_log = logging.getLogger(__name__)


def _wait_for(what: str, is_there: Callable[[], bool], give_up: Callable[[], bool]) -> None:
    logged_s = time.monotonic()
    while not is_there() and not give_up():
        if time.monotonic() - logged_s >= WAITING_LOG_PERIOD_S:
            logged_s = time.monotonic()
            _log.info("waiting for %s", what)
        time.sleep(LOOK_PERIOD_S)


def _whole_parameter(name: str) -> int:
    value = rospy.get_param(f"~{name}", "")
    try:
        return int(value)
    except ValueError:
        raise ConfigurationError(f"invalid {name} {value!r}: must be a whole number") from None


def _is_served(node_id: int) -> bool:
    switch = PersistentService(names.power_switch(node_id), PowerSwitch)
    try:
        switch.connect()
    except ServiceGone:
        return False
    switch.close()
    return True


def _obstacles_of(fleet: FactoryConfiguration) -> Obstacles | None:
    """The boxes of the world; None, with a warning, if this machine does not have their file."""
    try:
        return configured_obstacles(fleet)
    except ConfigurationError as error:
        _log.warning(
            "%s; orders into obstacles are refused by the world only, not by these nodes", error
        )
        return None


def ids_to_serve(fleet: FactoryConfiguration) -> range:
    """The ids that the parameters select: ~first..~last, or share ~index of ~hosts equal shares.

    Raises ConfigurationError for ids that the world does not have or another process serves.
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
        if len(ids) == 0 or ids[0] < 0 or ids[-1] >= count:
            raise ConfigurationError(
                f"invalid first..last {ids.start}..{ids.stop - 1}: the drones are 0..{count - 1}"
            )
    served = [node_id for node_id in ids if _is_served(node_id)]
    if served:
        raise ConfigurationError(f"node {served[0]} is already hosted by another process")
    return ids


def main() -> None:
    """Virtual Raspberry Pis outside the world's process, perhaps on another machine.

    Parameters (private): ~first and ~last (int): the ids to host; or ~index and ~hosts (int):
    host share number ~index (from 1) of ~hosts equal shares of all drones.
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
        fleet = get_fleet_parameter()
        ids = or_stop(lambda: ids_to_serve(fleet))
        _log.info("serving %s", f"drones {ids.start}..{ids.stop - 1}" if ids else "no drones")
        settings = or_stop(lambda: MeshSettings.of(fleet, _obstacles_of(fleet)))
        host = MeshHost(settings, lambda: clock.now_s, stop.fail)
        # The world waits for declared hosts only.
        rospy.set_param(names.host_param(rospy.get_name()), [ids.start, ids.stop - 1])
        MasterWatch(names.host_param(rospy.get_name())).start()
        clock.drive(host)
        host.start()
        try:
            host.wait_for_radios(stop.requested)
            # Otherwise time would go on while the nodes start, and their timers would be late.
            _wait_for(
                "/DroneFactory to subscribe to the progress", clock.is_followed, stop.requested
            )
            clock.report_progress()
            host.serve(ids)
            while not stop.wait(PROGRESS_PERIOD_S):
                clock.report_progress()
        finally:
            host.stop()
