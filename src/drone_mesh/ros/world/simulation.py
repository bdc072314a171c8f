"""Simulation: the world, its drones, and by default their nodes, built and run."""

from __future__ import annotations

import logging
from collections import deque

from drone_mesh.nrf24.settings import data_rate
from drone_mesh.ros.graph import names
from drone_mesh.ros.graph.fleet_parameter import set_fleet_parameter
from drone_mesh.ros.graph.master_watch import MasterWatch
from drone_mesh.ros.graph.orderly_stop import OrderlyStop
from drone_mesh.ros.host.emulated_radios import EmulatedRadios
from drone_mesh.ros.host.mesh_host import MeshHost
from drone_mesh.ros.world.drone_views import drone_views
from drone_mesh.ros.world.engine_server import EngineServer, PositionReporter
from drone_mesh.ros.world.external_engines import ExternalEngines
from drone_mesh.ros.world.factory_parameters import FactoryParameters
from drone_mesh.ros.world.mesh_state import MeshStatePublisher, WorldView
from drone_mesh.ros.world.world_runner import WorldRunner
from drone_mesh.ros.world.world_window import window_of
from drone_mesh.state.model import EventRecord
from drone_mesh.state.observation import describe_obstacles
from drone_mesh.world.bullet_world import BulletWorld
from drone_mesh.world.factory import DroneFactory

_log = logging.getLogger(__name__)


class Simulation:
    """Built in `world` and run in the main thread, which steps the world."""

    def __init__(self, parameters: FactoryParameters, world: BulletWorld) -> None:
        """Make the drones. Nothing runs yet."""
        self._parameters = parameters
        self._world = world
        self._happened: deque[EventRecord] = deque()  # to the drones; any thread fills it
        configuration = parameters.configuration
        self._drones = DroneFactory(
            world,
            configuration.gateways,
            configuration.routers,
            configuration.gridsize,
            configuration.spacing,
            configuration.debug,
            (configuration.wind_x, configuration.wind_y, 0.0)
            if configuration.flight == "dynamic"
            else None,
            parameters.obstacles,
        ).drones
        _log.info(
            "fleet: gateways %d, routers %d, spacing %g m",
            configuration.gateways,
            configuration.routers,
            configuration.spacing,
        )

    def run(self, stop: OrderlyStop) -> None:
        """Offer the engines, start the nodes, and step until `stop` is requested."""
        if self._parameters.configuration.drones == "external":
            ExternalEngines(self._drones)
        else:
            reporter = PositionReporter(self._drones)
            for drone in self._drones:
                if stop.requested():
                    return
                EngineServer(drone, reporter, self._happened.append)
        host = self._start_host(stop)
        set_fleet_parameter(self._parameters.configuration)
        MasterWatch(names.FLEET_PARAM, names.SIM_TIME_PARAM).start()
        try:
            self._step(host, stop)
        finally:
            if host is not None:
                host.stop()

    def _start_host(self, stop: OrderlyStop) -> MeshHost | None:
        """The nodes of this process, while they start; None: they run in others."""
        if self._parameters.hosts != 1 or not self._drones:
            return None
        configuration, world = self._parameters.configuration, self._world
        radios = None
        if configuration.radio == "nrf24":
            radios = EmulatedRadios(
                self._drones,
                configuration.max_distance,
                data_rate(configuration.data_rate),
                configuration.seed,
                lambda: world.now_s,
            )
        else:
            _log.info("radio virtual: an ideal disc, range %g m", configuration.max_distance)
        host = MeshHost(self._parameters.settings, lambda: world.now_s, stop.fail, radios)
        host.start()
        host.wait_for_radios(stop.requested)
        host.serve(drone.node_id for drone in self._drones)
        return host

    def _step(self, host: MeshHost | None, stop: OrderlyStop) -> None:
        configuration, world, drones = self._parameters.configuration, self._world, self._drones
        runner = WorldRunner(world, configuration.real_time_factor, host)

        def look() -> WorldView:
            now_s = world.now_s
            views = drone_views(drones, now_s)
            return WorldView(now_s, views, runner.wanted_factor, runner.paused)

        obstacles = self._parameters.obstacles
        state = MeshStatePublisher(
            look,
            configuration.max_distance,
            configuration.routing,
            configuration.repair,
            self._happened,
            describe_obstacles(obstacles.boxes if obstacles else ()),
            configuration.shape,
        )
        state.start()
        window = window_of(world, drones, state) if configuration.gui else None
        if window is not None:
            window.start()
        try:
            runner.run(stop.requested)
        finally:
            if window is not None:
                window.stop()
            state.stop()
