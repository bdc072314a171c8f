"""The node /DroneFactory: the world, the drones in it, and by default their Raspberry Pis."""

from __future__ import annotations

import logging
import time
from collections import deque
from dataclasses import replace

import rospy

from drone_mesh.drone.flight_path import Vector
from drone_mesh.nrf24.settings import data_rate
from drone_mesh.ros.graph import names
from drone_mesh.ros.graph.command_line import start_node
from drone_mesh.ros.graph.conversions import NO_POSITION
from drone_mesh.ros.graph.fleet_parameter import set_fleet_parameter
from drone_mesh.ros.graph.logs import show_library_logs_on_rosout
from drone_mesh.ros.graph.master_watch import MasterWatch
from drone_mesh.ros.graph.orderly_stop import OrderlyStop
from drone_mesh.ros.graph.parameters import or_exit
from drone_mesh.ros.host.emulated_radios import EmulatedRadios
from drone_mesh.ros.host.mesh_host import MeshHost
from drone_mesh.ros.world.drone_views import drone_views
from drone_mesh.ros.world.engine_server import EngineServers, ExternalEngines
from drone_mesh.ros.world.factory_parameters import FactoryParameters
from drone_mesh.ros.world.fleet_changes import FleetChanges
from drone_mesh.ros.world.mesh_state import MeshStatePublisher, WorldView
from drone_mesh.ros.world.pilots import start_pilots
from drone_mesh.ros.world.world_runner import WorldRunner
from drone_mesh.state.links import LostLinks, known_links
from drone_mesh.state.model import EventRecord, MeshStatus
from drone_mesh.state.observation import describe_obstacles
from drone_mesh.view.scene import Scene, scene_of
from drone_mesh.view.window_process import WindowProcess
from drone_mesh.world.factory import DroneFactory
from drone_mesh.world.interfaces import World
from drone_mesh.world.physics import open_world

MQTT_SENDER = {0: "with internet mqtt it sends the messages published on the broker"}

_log = logging.getLogger(__name__)


class RosSimulation:
    """Built in `world` and run in the main thread, which steps the world."""

    def __init__(self, parameters: FactoryParameters, world: World) -> None:
        """Create the drones. Nothing runs yet."""
        self._parameters = parameters
        self._world = world
        self._happened: deque[EventRecord] = deque()  # events of the drones; any thread fills it
        configuration = parameters.configuration
        self._factory = DroneFactory(
            world,
            parameters.fleet,
            (configuration.wind_x, configuration.wind_y, 0.0)
            if configuration.flight == "dynamic"
            else None,
            parameters.obstacles,
            configuration.cruise_height,
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
        engines = None
        if self._parameters.configuration.drones == "external":
            ExternalEngines(self._factory)
        else:
            engines = EngineServers(
                self._factory, self._parameters.settings.run, self._happened.append
            )
            for drone in self._factory.drones:
                if stop.requested():
                    return
                engines.offer(drone)
        radios = self._make_radios()
        host = self._start_host(radios, stop)
        try:
            self._step(host, radios, engines, stop)
        finally:
            if host is not None:
                host.stop()

    def _place_of(self, node_id: int) -> Vector:
        """Where the engine of this drone is; NO_POSITION if there is none (yet, or any more)."""
        drone = self._factory.get(node_id)
        return NO_POSITION if drone is None else drone.engine.state.position

    def _make_radios(self) -> EmulatedRadios | None:
        """The emulated chips; None: the radio is virtual."""
        configuration = self._parameters.configuration
        if configuration.radio == "nrf24":
            return EmulatedRadios(
                self._factory.drones,
                configuration.max_distance,
                data_rate(configuration.data_rate),
                configuration.seed,
            )
        _log.info("radio virtual: an ideal disc, range %g m", configuration.max_distance)
        return None

    def _start_host(self, radios: EmulatedRadios | None, stop: OrderlyStop) -> MeshHost | None:
        """Start the nodes of this process; returns None if other processes run them."""
        if self._parameters.hosts != 1:
            return None
        world = self._world
        host = MeshHost(
            self._parameters.settings, lambda: world.now_s, stop.fail, self._place_of, radios
        )
        host.start()
        if self._factory.drones:
            host.wait_for_radios(stop.requested)
        host.start_nodes({drone.node_id: drone.role for drone in self._factory.drones})
        return host

    def _step(
        self,
        host: MeshHost | None,
        radios: EmulatedRadios | None,
        engines: EngineServers | None,
        stop: OrderlyStop,
    ) -> None:
        configuration, world = self._parameters.configuration, self._world
        run = self._parameters.settings.run
        runner = WorldRunner(world, run, configuration.real_time_factor, host)
        obstacles = self._parameters.obstacles
        settings = MeshStatus(
            world.now_s,
            (),
            configuration.max_distance,
            routing=str(configuration.node.routing),
            repair_strategy=str(configuration.node.repair),
            obstacles=describe_obstacles(obstacles.boxes if obstacles else ()),
            shape=configuration.shape,
        )

        def read_view() -> WorldView:
            factor, paused = runner.wanted_factor, runner.paused
            now = replace(settings, stamp_s=world.now_s, real_time_factor=factor, paused=paused)
            return now, drone_views(self._factory.drones, now.stamp_s)

        state = MeshStatePublisher(run, read_view, self._happened)
        state.start()
        watch = MasterWatch(names.FLEET_PARAM, names.SIM_TIME_PARAM)
        changes = FleetChanges(
            self._factory,
            runner,
            state,
            engines,
            host,
            radios,
            watch,
            MQTT_SENDER if configuration.internet == "mqtt" else {},
        )
        if rospy.has_param(names.STANDING_PARAM):  # of a world that has ended
            rospy.delete_param(names.STANDING_PARAM)
        set_fleet_parameter(configuration)  # last: hosts wait for it
        watch.start()
        window = self._window(state) if configuration.gui else None
        if window is not None:
            window.start()
        try:
            runner.run(stop.requested)
        finally:
            if window is not None:
                window.stop()
            changes.stop()
            state.stop()

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
        RosSimulation(parameters, world).run(stop)
