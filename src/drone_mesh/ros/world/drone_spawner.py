"""DroneSpawner: spawns and despawns one drone of a running simulation, with its engine and node."""

from __future__ import annotations

import functools
from typing import Sequence

import rospy

from drone_mesh.drone.roles import Role
from drone_mesh.ros.host.emulated_radios import EmulatedRadios
from drone_mesh.ros.host.mesh_host import MeshHost
from drone_mesh.ros.world.engine_server import EngineServers
from drone_mesh.ros.world.mesh_state import MeshStatePublisher
from drone_mesh.ros.world.world_runner import WorldRunner
from drone_mesh.world.drones import VirtualDrone
from drone_mesh.world.factory import DroneFactory


class DroneSpawner:
    """For one thread only. Changes to the world are made in the world's thread."""

    def __init__(
        self,
        factory: DroneFactory,
        runner: WorldRunner,
        state: MeshStatePublisher,
        engines: EngineServers | None,
        host: MeshHost | None,
        radios: EmulatedRadios | None,
    ) -> None:
        """`engines` is None if other nodes fly the drones, `host` if others run all nodes."""
        self._factory = factory
        self._runner = runner
        self._state = state
        self._engines = engines
        self._host = host
        self._radios = radios

    def spawn(
        self, role: Role, longitude: float, latitude: float, node_id: int | None
    ) -> VirtualDrone:
        """Add a drone to the world and offer its engine. Raises FleetRefused."""

        def spawn() -> VirtualDrone:
            drone = self._factory.add(role, longitude, latitude, node_id)
            if self._radios is not None:
                self._radios.place(drone)
            return drone

        drone = self._runner.between_steps(spawn)
        if self._engines is not None:
            self._engines.offer(drone)
        return drone

    def despawn(self, drone: VirtualDrone) -> None:
        """Withdraw the engine of a drone and remove it from the world. Raises FleetRefused."""
        if self._engines is not None:
            self._engines.withdraw(drone.node_id)
        self._runner.between_steps(functools.partial(self._factory.remove, drone.node_id))
        self._state.forget(drone.node_id)

    def hosts(self) -> Sequence[str]:
        """The ROS nodes that can run the node of a new drone."""
        return self._runner.hosts() if self._host is None else [rospy.get_name()]

    def start_node(self, node_id: int, role: Role) -> None:
        """Start the node of a drone if this process runs the nodes."""
        if self._host is not None:
            self._host.start_nodes({node_id: role})

    def end_node(self, node_id: int) -> None:
        """End the node of a drone if this process runs the nodes."""
        if self._host is not None:
            self._host.end_node(node_id)
