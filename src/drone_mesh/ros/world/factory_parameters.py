"""FactoryParameters: the parameters of the node /DroneFactory, checked as a whole."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Mapping, Sequence

import rospy

from drone_mesh.air.obstacles import Obstacles
from drone_mesh.arguments import is_whole
from drone_mesh.configuration import FactoryConfiguration
from drone_mesh.drone.fleet import StartPlace, plan_fleet
from drone_mesh.drone.goal import MAX_HEIGHT_M
from drone_mesh.errors import ConfigurationError
from drone_mesh.formations.missions import Mission
from drone_mesh.ros.graph.parameters import (
    configured_missions,
    configured_obstacles,
    factory_configuration,
    manager_layouts,
)
from drone_mesh.ros.graph.run import new_run
from drone_mesh.ros.host.mesh_settings import MeshSettings
from drone_mesh.view.window_process import require_screen
from drone_mesh.world.factory import check_starts
from drone_mesh.world.physics import require_pybullet


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
        obstacles = configured_obstacles(configuration)
        if obstacles is not None:
            check_starts(fleet, obstacles)
            if configuration.cruise_height < MAX_HEIGHT_M:
                raise ConfigurationError(
                    "argument: cruise_height does not go with obstacles: flights cross over boxes"
                )
        missions = configured_missions(configuration)
        if configuration.drones == "external" and (missions or configuration.mobility != "none"):
            raise ConfigurationError(
                "argument: missions and mobility need drones builtin: others fly external drones"
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
