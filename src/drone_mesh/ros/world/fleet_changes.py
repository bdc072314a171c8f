"""FleetChanges: adds drones to the running simulation and removes them."""

from __future__ import annotations

import functools
import logging
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from typing import Mapping

import rospy
from std_msgs.msg import String

from drone_mesh import srv
from drone_mesh.drone.fence import Fence
from drone_mesh.drone.roles import Role
from drone_mesh.errors import FleetRefused
from drone_mesh.ros.graph import names
from drone_mesh.ros.graph.master import MasterWatch
from drone_mesh.ros.graph.parameters import told_fence
from drone_mesh.ros.graph.simulation import PresentDrones
from drone_mesh.ros.graph.waiting import comes_true
from drone_mesh.ros.host.emulated_radios import EmulatedRadios
from drone_mesh.ros.host.mesh_host import MeshHost
from drone_mesh.ros.host.radios import node_runs
from drone_mesh.ros.world.engine_server import EngineServers
from drone_mesh.ros.world.mesh_state import MeshStatePublisher
from drone_mesh.ros.world.world_runner import WorldRunner
from drone_mesh.world.factory import DroneFactory, VirtualDrone

NODE_TIMEOUT_S = 5.0  # wall: how long a node may take to start or to end

_log = logging.getLogger(__name__)


class FleetChanges:
    """Services: /DroneFactory/addDrone (AddDrone), /DroneFactory/removeDrone (RemoveDrone).

    Subscribes: /DroneManager/fence (String), which all drones keep from then on
    Sets /drone_mesh/drones, from which other processes learn of each change.

    One thread makes all changes in sequence; the first request starts it. Threads of rospy wait for
    it. It changes the world in the world's thread.
    """

    def __init__(
        self,
        factory: DroneFactory,
        runner: WorldRunner,
        state: MeshStatePublisher,
        engines: EngineServers | None,
        host: MeshHost | None,
        radios: EmulatedRadios | None,
        watch: MasterWatch,
        needed: Mapping[int, str],
    ) -> None:
        """`engines` is None if other nodes fly the drones, `host` if others run all nodes.

        `watch` restores its parameters after a restart of the master. `needed`: drones that cannot
        be removed, with the reason.
        """
        self._factory, self._runner, self._state = factory, runner, state
        self._engines, self._host, self._radios = engines, host, radios
        self._watch, self._needed = watch, needed
        self._hosts: dict[int, str] = {}  # drone added here -> ROS node that runs its node
        self._worker = ThreadPoolExecutor(1, "fleet changes")
        self._publish()
        self._services = (
            rospy.Service(names.ADD_DRONE_SERVICE, srv.AddDrone, self._add_requested),
            rospy.Service(names.REMOVE_DRONE_SERVICE, srv.RemoveDrone, self._remove_requested),
        )
        self._fence = rospy.Subscriber(names.FENCE_TOPIC, String, self._fence_told)

    def stop(self) -> None:
        """Withdraw the services; returns when the thread has ended."""
        for service in self._services:
            service.shutdown()
        self._fence.unregister()
        self._worker.shutdown()

    # Threads of rospy ------------------------------------------------------------------------

    def _add_requested(self, request: srv.AddDroneRequest) -> srv.AddDroneResponse:
        try:
            return self._worker.submit(self._add, request).result()
        except FleetRefused as error:
            return srv.AddDroneResponse(success=False, id=request.id, message=str(error))

    def _remove_requested(self, request: srv.RemoveDroneRequest) -> srv.RemoveDroneResponse:
        try:
            return self._worker.submit(self._remove, request.id).result()
        except FleetRefused as error:
            return srv.RemoveDroneResponse(success=False, message=str(error))

    def _fence_told(self, told: String) -> None:
        self._worker.submit(self._keep_to, told_fence(told), told.data)

    # The thread of the changes ---------------------------------------------------------------

    def _add(self, request: srv.AddDroneRequest) -> srv.AddDroneResponse:
        role = Role.GATEWAY if request.gateway else Role.ROUTER
        wanted = None if request.id == srv.AddDroneRequest.LOWEST_FREE else request.id

        def spawn() -> VirtualDrone:
            drone = self._factory.add(role, request.longitude, request.latitude, wanted)
            if self._radios is not None:
                self._radios.place(drone)
            return drone

        drone = self._runner.between_steps(spawn)
        if self._engines is not None:
            self._engines.offer(drone)
        node_id = drone.node_id
        host = self._least_busy_host()
        self._hosts[node_id] = host
        self._publish()
        if self._host is not None:
            self._host.start_nodes({node_id: role})
        message = (
            f"added {role.word} {node_id} at x {request.longitude:g} m, y {request.latitude:g} m; "
            f"{self._await_start(node_id, host)}"
        )
        _log.info("%s", message)
        return srv.AddDroneResponse(success=True, id=node_id, message=message)

    def _remove(self, node_id: int) -> srv.RemoveDroneResponse:
        drone = self._factory.check_removal(node_id)
        if node_id in self._needed:
            raise FleetRefused(f"drone {node_id} cannot be removed: {self._needed[node_id]}")
        self._hosts.pop(node_id, None)
        self._publish(without=node_id)
        if self._host is not None:
            self._host.end_node(node_id)
        if not comes_true(lambda: not node_runs(node_id), NODE_TIMEOUT_S):
            _log.warning("the process that hosts node %d has not ended it", node_id)
        if self._engines is not None:
            self._engines.withdraw(node_id)
        self._runner.between_steps(functools.partial(self._factory.remove, node_id))
        self._state.forget(node_id)
        message = f"removed {drone.role.word} {node_id}"
        _log.info("%s", message)
        return srv.RemoveDroneResponse(success=True, message=message)

    def _keep_to(self, fence: Fence | None, areas: str) -> None:
        if fence is None:
            return
        self._watch.keep(names.FENCE_PARAM, areas)
        self._runner.between_steps(functools.partial(self._factory.keep_to, fence))
        if self._host is not None:
            self._host.keep_to(fence)
        _log.info("fence: %s", fence.names or "none")

    def _least_busy_host(self) -> str:
        """The host with the fewest added drones; empty: there is none."""
        busy = Counter(self._hosts.values())
        hosts = self._runner.hosts() if self._host is None else [rospy.get_name()]
        return min(hosts, key=lambda host: (busy[host], host), default="")

    def _await_start(self, node_id: int, host: str) -> str:
        if not host:
            return (
                "no host process runs its node; start one: "
                f"roslaunch drone_mesh host.launch first:={node_id} last:={node_id}"
            )
        if comes_true(lambda: node_runs(node_id), NODE_TIMEOUT_S):
            return f"{host} runs its node"
        return f"{host} has not started its node yet"

    def _publish(self, without: int | None = None) -> None:
        roles = {d.node_id: d.role for d in self._factory.drones if d.node_id != without}
        value = PresentDrones(roles, self._hosts).to_parameter()
        rospy.set_param(names.DRONES_PARAM, value)
        self._watch.keep(names.DRONES_PARAM, value)
