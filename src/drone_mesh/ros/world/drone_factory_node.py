"""The node /DroneFactory: the world, the drones in it, and by default their Raspberry Pis."""

from __future__ import annotations

import logging
import time
from collections import deque
from contextlib import ExitStack
from dataclasses import dataclass, fields, replace
from typing import Callable, Mapping, Sequence

import rospy

from drone_mesh.air.obstacles import Obstacles
from drone_mesh.arguments import is_whole
from drone_mesh.configuration import FactoryConfiguration
from drone_mesh.drone.battery import Crews, PowerModel
from drone_mesh.drone.fleet import StartPlace, plan_fleet
from drone_mesh.drone.flight_path import Vector
from drone_mesh.drone.goal import MAX_HEIGHT_M
from drone_mesh.errors import ConfigurationError
from drone_mesh.formations.missions import Mission
from drone_mesh.nrf24.settings import data_rate
from drone_mesh.ros.graph import names
from drone_mesh.ros.graph.command_line import start_node
from drone_mesh.ros.graph.conversions import NO_POSITION
from drone_mesh.ros.graph.fleet_parameter import set_fleet_parameter
from drone_mesh.ros.graph.logs import show_library_logs_on_rosout
from drone_mesh.ros.graph.master import MasterWatch
from drone_mesh.ros.graph.orderly_stop import OrderlyStop
from drone_mesh.ros.graph.parameters import (
    configured_missions,
    configured_obstacles,
    factory_configuration,
    fence_areas,
    manager_layouts,
    or_exit,
)
from drone_mesh.ros.graph.simulation import new_run
from drone_mesh.ros.host.emulated_radios import EmulatedRadios
from drone_mesh.ros.host.mesh_host import MeshHost
from drone_mesh.ros.host.virtual_raspberry_pi import MeshSettings
from drone_mesh.ros.world.engine_server import EngineServers, ExternalEngines
from drone_mesh.ros.world.fleet_changes import FleetChanges
from drone_mesh.ros.world.mesh_state import MeshStatePublisher, WorldView, drone_views
from drone_mesh.ros.world.pilots import start_pilots
from drone_mesh.ros.world.world_runner import WorldRunner
from drone_mesh.state.links import LostLinks, known_links
from drone_mesh.state.model import EventRecord, MeshStatus
from drone_mesh.state.observation import describe_fence, describe_obstacles
from drone_mesh.view.scene import Scene, scene_of
from drone_mesh.view.window_process import WindowProcess, require_screen
from drone_mesh.world.body import BodyLimits
from drone_mesh.world.factory import DroneFactory
from drone_mesh.world.physics import open_world, require_pybullet
from drone_mesh.world.worlds import World

MQTT_SENDER = {0: "with internet mqtt it sends the messages published on the broker"}

_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class FactoryParameters:
    """A configuration that can be built."""

    configuration: FactoryConfiguration
    settings: MeshSettings
    fleet: Sequence[StartPlace]
    obstacles: Obstacles | None
    missions: Mapping[int, Mission]
    hosts: int  # 1: the nodes run in this process; otherwise in others

    @classmethod
    def read(cls) -> FactoryParameters:
        """The private parameters over the configuration file. Raises ConfigurationError."""
        configuration = factory_configuration(*(key.name for key in fields(FactoryConfiguration)))
        fleet = plan_fleet(
            configuration.gateways,
            configuration.routers,
            configuration.gridsize,
            configuration.spacing,
        )
        if rospy.has_param(names.FENCE_PARAM):  # of a world that has ended
            rospy.delete_param(names.FENCE_PARAM)
        obstacles = configured_obstacles(configuration)
        if configuration.fence:  # for what starts later: the file may be another then
            rospy.set_param(names.FENCE_PARAM, fence_areas(configuration))
        if configuration.obstacles and configuration.cruise_height < MAX_HEIGHT_M:
            raise ConfigurationError(
                "argument: cruise_height does not go with obstacles: flights cross over boxes"
            )
        if configuration.fence and configuration.mobility != "none":
            raise ConfigurationError(
                "argument: mobility does not go with a fence: its models know none; missions do"
            )
        missions = configured_missions(configuration)
        if configuration.drones == "external" and (missions or configuration.mobility != "none"):
            raise ConfigurationError(
                "argument: missions and mobility need drones builtin: others fly external drones"
            )
        if configuration.relief != "none" and configuration.flight != "dynamic":
            raise ConfigurationError(
                "argument: relief needs flight dynamic: others have no battery"
            )
        unknown = sorted(missions.keys() - {place.node_id for place in fleet})
        if unknown:
            raise ConfigurationError(f"missions: there is no drone {unknown[0]}")
        if configuration.gui:
            require_screen("gui")
            require_pybullet("gui")
        # With a bad layout file the manager would be restarted for ever; this ends the launch.
        manager_layouts()
        hosts = str(rospy.get_param("~hosts", "") or 1)
        if not (is_whole(hosts) and int(hosts) >= 0):
            raise ConfigurationError(
                f"argument: invalid hosts {hosts!r}: expected a whole number, 0 or more"
            )
        if configuration.radio == "nrf24":
            _check_emulated_radio(configuration, int(hosts))
        settings = MeshSettings.from_configuration(configuration, new_run(), obstacles)
        return cls(configuration, settings, fleet, obstacles, missions, int(hosts))


def _check_emulated_radio(configuration: FactoryConfiguration, hosts: int) -> None:
    if configuration.obstacles:
        raise ConfigurationError(
            "argument: obstacles need radio virtual: the emulated chips ignore boxes"
        )
    if hosts != 1:
        raise ConfigurationError(
            f"argument: invalid hosts {hosts}: must be 1 with radio nrf24: all emulated chips "
            "share one air in one process"
        )
    if configuration.real_time_factor != 1.0:
        raise ConfigurationError(
            f"invalid real_time_factor {configuration.real_time_factor:g}: must be 1 with radio "
            "nrf24, since the emulated chips run in wall time"
        )


class RosSimulation:
    """Built in `world` and run in the main thread, which steps the world."""

    def __init__(self, parameters: FactoryParameters, world: World) -> None:
        """Create the drones. Nothing runs yet."""
        self._parameters = parameters
        self._configuration = configuration = parameters.configuration
        self._world = world
        self._happened: deque[EventRecord] = deque()  # events of the drones; any thread fills it
        wind = (configuration.wind_x, configuration.wind_y, 0.0)
        relieves = configuration.relief != "none"
        self._factory = DroneFactory(
            world,
            parameters.fleet,
            wind if configuration.flight == "dynamic" else None,
            parameters.obstacles,
            configuration.cruise_height,
            BodyLimits(power=PowerModel(hover_s=60.0 * configuration.hover_minutes)),
            Crews(configuration.swap_time, configuration.swaps_at_once) if relieves else None,
        )
        start_pilots(configuration, parameters.missions, self._factory.drones)
        _log.info(
            "fleet: gateways %d, routers %d, spacing %g m",
            configuration.gateways,
            configuration.routers,
            configuration.spacing,
        )
        if parameters.settings.key is None:
            _log.warning(
                "no key: any program on this ROS network can pose as a node and order flights; "
                "raspberry_key new makes a key, key:=FILE uses it"
            )

    def run(self, stop: OrderlyStop) -> None:
        """Offer the engines, start the nodes, and step the world until `stop` is requested."""
        parameters, configuration = self._parameters, self._configuration
        run, drones = parameters.settings.run, self._factory.drones
        engines = None
        if configuration.drones == "external":
            ExternalEngines(self._factory)
        else:
            engines = EngineServers(self._factory, run, self._happened.append)
            for drone in drones:
                if stop.requested():
                    return
                engines.offer(drone)
        radios, host = self._make_radios(), None
        with ExitStack() as ends:
            if parameters.hosts == 1:
                host = MeshHost(
                    parameters.settings,
                    lambda: self._world.now_s,
                    stop.fail,
                    self._place_of,
                    radios,
                )
                ends.callback(host.stop)
                host.start()
                if drones:
                    host.wait_for_radios(stop.requested)
                host.start_nodes({drone.node_id: drone.role for drone in drones})
            runner = WorldRunner(self._world, run, configuration.real_time_factor, host)
            state = MeshStatePublisher(run, self._view_of(runner), self._happened)
            state.start()
            ends.callback(state.stop)
            watch = MasterWatch(names.FLEET_PARAM, names.SIM_TIME_PARAM, names.FENCE_PARAM)
            needed = MQTT_SENDER if configuration.internet == "mqtt" else {}
            changes = FleetChanges(
                self._factory, runner, state, engines, host, radios, watch, needed
            )
            ends.callback(changes.stop)
            if rospy.has_param(names.STANDING_PARAM):  # of a world that has ended
                rospy.delete_param(names.STANDING_PARAM)
            set_fleet_parameter(configuration)  # last: hosts wait for it
            watch.start()
            if configuration.gui:
                window = self._window(state)
                window.start()
                ends.callback(window.stop)
            runner.run(stop.requested)

    def _place_of(self, node_id: int) -> Vector:
        """Where the engine of this drone is; NO_POSITION if there is none (yet, or any more)."""
        drone = self._factory.get(node_id)
        return NO_POSITION if drone is None else drone.engine.state.position

    def _make_radios(self) -> EmulatedRadios | None:
        """The emulated chips; None: the radio is virtual."""
        configuration = self._configuration
        if configuration.radio == "nrf24":
            rate = data_rate(configuration.data_rate)
            range_m, seed = configuration.max_distance, configuration.seed
            return EmulatedRadios(self._factory.drones, range_m, rate, seed)
        _log.info("radio virtual: an ideal disc, range %g m", configuration.max_distance)
        return None

    def _view_of(self, runner: WorldRunner) -> Callable[[], WorldView]:
        """What makes the world's share of a state."""
        configuration, obstacles = self._configuration, self._parameters.obstacles
        settings = MeshStatus(
            self._world.now_s,
            (),
            configuration.max_distance,
            routing=str(configuration.node.routing),
            repair_strategy=str(configuration.node.repair),
            obstacles=describe_obstacles(obstacles.boxes if obstacles else ()),
            shape=configuration.shape,
        )

        def read() -> WorldView:
            now_s, factor = self._world.now_s, runner.wanted_factor
            fence = describe_fence(self._factory.fence)
            now = replace(settings, stamp_s=now_s, real_time_factor=factor, fence=fence)
            now = replace(now, paused=runner.paused)
            return now, drone_views(self._factory.drones, now_s)

        return read

    def _window(self, state: MeshStatePublisher) -> WindowProcess:
        """A window that is not started yet; it shows current positions and the latest state."""
        lost_links = LostLinks()

        def read_scene() -> Scene:
            mesh = state.latest
            if mesh is None:
                return Scene(title="starting")
            lost = lost_links.update(known_links(mesh.nodes), time.monotonic())
            return scene_of(mesh, lost, drone_views(self._factory.drones, self._world.now_s))

        return WindowProcess(read_scene)


def main() -> None:
    """Runs the world, the drones in it, and by default the nodes on the drones.

    Parameters (private): ~config (str): the configuration file, config/factory.yaml by default;
    every key of that file: a parameter with its name overrides the file; ~hosts (int, 1): with 1
    the nodes run in this process, with any other number in other processes. The program also
    checks the layout file that /DroneManager/casus names.
    """
    start_node(main.__doc__, "DroneFactory", disable_signals=True)
    show_library_logs_on_rosout()
    parameters = or_exit(FactoryParameters.read)
    dynamic = parameters.configuration.flight == "dynamic"
    with OrderlyStop() as stop, or_exit(lambda: open_world(dynamic)) as world:
        or_exit(lambda: RosSimulation(parameters, world)).run(stop)
