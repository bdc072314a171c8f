"""The node /DroneFactory: the world, the drones in it, and by default their Raspberry Pis."""

from __future__ import annotations

import dataclasses
import logging

import rospy

from drone_mesh.configuration import FactoryConfiguration
from drone_mesh.drone.fleet import plan_fleet
from drone_mesh.errors import ConfigurationError
from drone_mesh.ros.graph.command_line import prepare_node
from drone_mesh.ros.graph.logs import show_library_logs_on_rosout
from drone_mesh.ros.graph.orderly_stop import OrderlyStop
from drone_mesh.ros.graph.parameters import factory_configuration, manager_layouts, or_stop
from drone_mesh.ros.host.emulated_nrf24 import EmulatedRadios
from drone_mesh.ros.host.fleet import mesh_settings, tell_hosts
from drone_mesh.ros.host.mesh_host import MeshHost
from drone_mesh.ros.host.virtual_raspberry_pi import MeshSettings
from drone_mesh.ros.world.engine_server import EngineServer, PositionReporter
from drone_mesh.ros.world.mesh_state import MeshStatePublisher, WorldView
from drone_mesh.ros.world.world_runner import WorldRunner
from drone_mesh.ros.world.world_window import window_of
from drone_mesh.state.observation import view_drone
from drone_mesh.view.window_process import require_screen
from drone_mesh.world.bullet_world import BulletWorld
from drone_mesh.world.factory import DroneFactory

_log = logging.getLogger(__name__)


def _read_parameters() -> tuple[FactoryConfiguration, MeshSettings, int]:
    keys = [key.name for key in dataclasses.fields(FactoryConfiguration)]
    configuration = factory_configuration(*keys)
    fleet = (configuration.gateways, configuration.routers)
    plan_fleet(*fleet, configuration.gridsize, configuration.spacing)
    if configuration.gui:
        require_screen()
    manager_layouts()  # with a bad file the manager is restarted for ever; this ends the launch
    hosts = str(rospy.get_param("~hosts", "") or 1)
    if not hosts.isdigit():
        raise ConfigurationError(f"argument: hosts is {hosts!r}, want a whole number, 0 or more")
    if configuration.radio == "nrf24":
        if int(hosts) != 1:
            raise ConfigurationError(
                f"argument: hosts is {hosts}, but with radio nrf24 all chips are on one air, "
                "which lives in one process: want 1"
            )
        if configuration.real_time_factor != 1.0:
            raise ConfigurationError(
                f"real_time_factor is {configuration.real_time_factor:g}, but with radio nrf24 the "
                "chips live by the time of the wall: want 1"
            )
    return configuration, mesh_settings(configuration), int(hosts)


def main() -> None:
    """The world, the drones in it, and by default their Raspberry Pis.

    Parameters (private): all keys of config/factory.yaml, each overruling the file; ~config, that
    file; ~hosts (int, 1): 1 = the nodes run in this process, otherwise they are left to others;
    /DroneManager/casus, which is looked at only.
    """
    prepare_node(main.__doc__)
    rospy.init_node("DroneFactory", disable_signals=True)
    show_library_logs_on_rosout()
    configuration, settings, hosts = or_stop(_read_parameters)
    host = radios = None
    with OrderlyStop() as stop, BulletWorld() as world:
        factory = DroneFactory(
            world,
            configuration.gateways,
            configuration.routers,
            configuration.gridsize,
            configuration.spacing,
            configuration.debug,
        )
        _log.info(
            "%d gateways and %d routers, %g m apart",
            configuration.gateways,
            configuration.routers,
            configuration.spacing,
        )
        reporter = PositionReporter(factory.drones)
        for drone in factory.drones:
            if stop.requested():
                return
            EngineServer(drone, reporter)
        if hosts == 1 and factory.drones:
            if configuration.radio == "nrf24":
                radios = EmulatedRadios(
                    factory.drones, configuration.max_distance, configuration.seed
                )
            else:
                _log.info("radio virtual: an ideal disc of %g m", configuration.max_distance)
            host = MeshHost(settings, lambda: world.now_s, radios)
            host.start()
            if radios is None:
                host.wait_for_simulator(stop.requested)
            host.serve(drone.node_id for drone in factory.drones)
        tell_hosts(configuration)
        try:
            runner = WorldRunner(world, configuration.real_time_factor, host)
            state = MeshStatePublisher(
                lambda: WorldView(
                    world.now_s,
                    [view_drone(drone, world.now_s) for drone in factory.drones],
                    runner.wanted_factor,
                    runner.paused,
                ),
                configuration.max_distance,
            )
            state.start()
            window = window_of(world, factory.drones, state) if configuration.gui else None
            if window is not None:
                window.start()
            runner.run(stop.requested)
            if window is not None:
                window.stop()
            state.stop()
        finally:
            if host is not None:
                host.stop()
            if radios is not None:
                radios.close()
