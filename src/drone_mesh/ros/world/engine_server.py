"""The ROS side of the drones' engines, or of those of others (docs/ros.md, "World and flights")."""

from __future__ import annotations

import logging
import math
from typing import Callable

import rospy

from drone_mesh import srv
from drone_mesh.communication.events.observer import MeshEventKind
from drone_mesh.errors import GoalRefused
from drone_mesh.formations.missions import Mission
from drone_mesh.msg import DroneInfo
from drone_mesh.msg import Location as LocationMsg
from drone_mesh.ros.graph import names
from drone_mesh.ros.graph.conversions import NO_POSITION
from drone_mesh.ros.graph.logs import ThrottledLog
from drone_mesh.ros.graph.simulation import Run, is_left_behind
from drone_mesh.state.model import EventRecord
from drone_mesh.world.engine import DroneState
from drone_mesh.world.factory import DroneFactory, VirtualDrone

INFO_PERIOD_S = 0.05  # at most 20 DroneInfo per simulated second
_ROUNDING_S = 1e-6  # simulated time moves in hundredths, which floats do not hold exactly

_ACTIONS = (
    srv.FlyMissionRequest.FLY,
    srv.FlyMissionRequest.PAUSE,
    srv.FlyMissionRequest.RESUME,
    srv.FlyMissionRequest.STOP,
)

_log = logging.getLogger(__name__)


class EngineServer:
    """Offers the engine of one drone.

    Subscribes: /Drones/<id>/goal (Location). Services: /Drones/<id>/gps (RequestGPS),
    /Drones/<id>/mission (FlyMission).
    Goals and requests come in threads of rospy; `_moved` runs in the world's thread.
    """

    def __init__(
        self,
        drone: VirtualDrone,
        run: Run,
        report: Callable[[VirtualDrone], None],
        happened: Callable[[EventRecord], None],
    ) -> None:
        """`run` is the world's: goals of another run are not flown.

        `report` publishes the drone's position. `happened` is called in any thread with each of its
        events.
        """
        self._drone, self._node_id, self._engine = drone, drone.node_id, drone.engine
        self._run, self._report, self._happened = run, report, happened
        # The world's thread:
        self._reported_s = -math.inf
        self._reported = (False, False)  # whether it flew, whether it was flat
        self._throttled_log = ThrottledLog(_log)
        self._engine.add_listener(self._moved)
        self._engine.observe(self._observed)
        self._goals = rospy.Subscriber(names.goal_topic(drone.node_id), LocationMsg, self._goal)
        self._services = [
            rospy.Service(names.gps_service(drone.node_id), srv.RequestGPS, self._gps),
            rospy.Service(names.mission_service(drone.node_id), srv.FlyMission, self._mission),
        ]

    def close(self) -> None:
        self._goals.unregister()
        for service in self._services:
            service.shutdown()

    def _mission(self, request: srv.FlyMissionRequest) -> srv.FlyMissionResponse:
        engine = self._engine
        if request.action not in _ACTIONS:
            why_not = f"unknown action {request.action}: use {_ACTIONS[0]} to {_ACTIONS[-1]}"
            return srv.FlyMissionResponse(False, f"drone {self._node_id}: {why_not}")
        if request.action == srv.FlyMissionRequest.FLY:
            places = [(p.longitude, p.latitude, float(p.height)) for p in request.waypoints]
            why_not = engine.why_not_fly()
            try:
                mission = Mission(places, request.speed, request.loop)
                pilot = mission.pilot(engine.fence, engine.get_location().to_vector())
            except GoalRefused as error:
                why_not = str(error)
            if why_not:
                return srv.FlyMissionResponse(False, f"drone {self._node_id}: {why_not}")
            engine.fly_with(pilot)
        elif engine.pilot is None:
            return srv.FlyMissionResponse(False, f"drone {self._node_id} has no mission")
        elif request.action == srv.FlyMissionRequest.STOP:
            engine.fly_with(None)
        elif request.action == srv.FlyMissionRequest.PAUSE:
            engine.pause_pilot(True)
        else:
            here = engine.get_location().to_vector()
            why_not = engine.fence.why_not_straight([here, *engine.pilot.way_back(here)])
            if why_not:
                return srv.FlyMissionResponse(False, f"drone {self._node_id}: {why_not}")
            engine.pause_pilot(False)
        return srv.FlyMissionResponse(True, "")

    def _goal(self, goal: LocationMsg) -> None:
        if is_left_behind(goal, self._run):  # latched by a host that outlived its world
            return
        try:
            self._engine.set_goal(goal.latitude, goal.longitude, goal.height)
        except GoalRefused as error:
            self._throttled_log.note(f"drone {self._node_id} refused a goal", str(error))
            self._observed(MeshEventKind.GOAL_REFUSED, rospy.get_time(), str(error))

    def _observed(self, kind: MeshEventKind, now_s: float, detail: str) -> None:
        self._happened(EventRecord(now_s, self._node_id, kind.value, detail=detail))
        if kind is not MeshEventKind.GOAL_REFUSED:
            _log.warning("drone %d: %s%s", self._node_id, kind.value, detail and f", {detail}")

    def _gps(self, _request: srv.RequestGPSRequest) -> srv.RequestGPSResponse:
        latitude, longitude, height = self._engine.get_location()
        return srv.RequestGPSResponse(latitude, longitude, round(height))

    def _moved(self, state: DroneState) -> None:
        kind = (state.is_flying, self._engine.is_flat)
        is_due = state.now_s - self._reported_s >= INFO_PERIOD_S - _ROUNDING_S
        if is_due or kind != self._reported:
            self._reported_s, self._reported = state.now_s, kind
            self._report(self._drone)


class EngineServers(rospy.SubscribeListener):
    """The engines of all drones. After the start, one thread offers and withdraws them.

    Publishes /WirelessSignalSimulator (DroneInfo): the positions of all drones, to every simulator,
    with one publisher. Any thread.
    """

    def __init__(
        self, factory: DroneFactory, run: Run, happened: Callable[[EventRecord], None]
    ) -> None:
        """`run` and `happened` as for EngineServer."""
        self._factory, self._run, self._happened = factory, run, happened
        self._servers: dict[int, EngineServer] = {}
        self._publisher = rospy.Publisher(
            names.SIGNAL_TOPIC, DroneInfo, tcp_nodelay=True, queue_size=names.SIGNAL_QUEUE
        )
        # Added once the publisher exists; the report below reaches earlier subscribers.
        assert self._publisher.impl is not None  # it is not closed yet
        self._publisher.impl.add_subscriber_listener(self)
        self._report_all()

    def offer(self, drone: VirtualDrone) -> None:
        """Offer the engine of this drone, and report its position."""
        self._servers[drone.node_id] = EngineServer(drone, self._run, self._report, self._happened)
        self._report(drone)

    def withdraw(self, node_id: int) -> None:
        self._servers.pop(node_id).close()

    def peer_subscribe(self, _topic: str, _publish: object, _peer_publish: object) -> None:
        """A new subscriber, perhaps a simulator that was restarted: report all positions.

        Goes to all subscribers: rospy's way to reach only the new one is not thread-safe.
        """
        self._report_all()

    def _report_all(self) -> None:
        for drone in self._factory.drones:
            self._report(drone)

    def _report(self, drone: VirtualDrone) -> None:
        """Publish its position; a drone with a flat battery has no power either.

        docs/ros.md, "Sources of DroneInfo": an engine never gives a topic.
        """
        self._publisher.publish(drone.node_id, drone.engine.state.position, "", True)
        if drone.engine.is_flat:
            self._publisher.publish(drone.node_id, NO_POSITION, "", False)


class ExternalEngines:
    """Subscribes /WirelessSignalSimulator (DroneInfo): reports of the nodes that fly the drones.

    Those nodes offer what an engine of the world offers: they subscribe /Drones/<id>/goal, offer
    /Drones/<id>/gps, and publish DroneInfo without `sub`. Callbacks run in threads of rospy.
    """

    def __init__(self, factory: DroneFactory) -> None:
        self._factory = factory
        rospy.Subscriber(
            names.SIGNAL_TOPIC, DroneInfo, self._reported, queue_size=names.SIGNAL_QUEUE
        )

    def _reported(self, info: DroneInfo) -> None:
        x, y, z = info.position
        has_position = (x, y, z) != NO_POSITION or info.on
        if info.sub or not has_position or not math.isfinite(x + y + z):
            return
        drone = self._factory.get(info.nodeID)
        if drone is not None:
            drone.engine.follow((x, y, z))
