"""RosDroneEngineConnector: connects a mesh component to the engine of its drone."""

from __future__ import annotations

import logging
from typing import Callable

import rospy

from drone_mesh.air.obstacles import NO_PATH, Obstacles
from drone_mesh.drone.flight_path import SPEED_M_S
from drone_mesh.drone.interfaces import IDroneEngine
from drone_mesh.drone.location import Location
from drone_mesh.errors import GoalRefused, LocationUnknown
from drone_mesh.msg import Location as LocationMsg
from drone_mesh.ros.graph import names
from drone_mesh.ros.graph.conversions import location_msg, location_of
from drone_mesh.ros.graph.logs import ThrottledLog
from drone_mesh.ros.graph.persistent_service import PersistentService, ServiceGone, ServiceRefused
from drone_mesh.ros.graph.run import Run, run_headers
from drone_mesh.ros.host.silent_engines import SilentEngines
from drone_mesh.srv import RequestGPS, RequestGPSRequest, RequestGPSResponse

_log = logging.getLogger(__name__)


class RosDroneEngineConnector(IDroneEngine):
    """Publishes /Drones/<id>/goal (Location), calls /Drones/<id>/gps (RequestGPS).

    Belongs to the executor's worker. The connection is kept, and reopened when needed: by
    SilentEngines as long as an engine does not answer.
    """

    def __init__(
        self,
        node_id: int,
        run: Run,
        why_not_fly: Callable[[], str],
        silent: SilentEngines,
        obstacles: Obstacles | None = None,
    ) -> None:
        """`run` and `obstacles` are the world's, `silent` is the process's.

        `why_not_fly` returns why the drone cannot fly, empty if it can.

        The engine decides, but the topic of its goals has no reply, so goals that it
        would refuse are refused here as well.
        """
        self._obstacles = obstacles
        self._node_id = node_id
        self._why_not_fly = why_not_fly
        self._gps = PersistentService(names.gps_service(node_id), RequestGPS)
        self._silent = silent
        self._throttled_log = ThrottledLog(_log)
        # Latched: an order that arrives before rospy has connected to the engine must not be lost.
        self._goal = rospy.Publisher(
            names.goal_topic(node_id),
            LocationMsg,
            headers=run_headers(run),
            queue_size=10,
            latch=True,
        )

    def connect(self) -> None:
        """Connect before the first request, so that the number of connections stays constant."""
        try:
            self._connect()
        except ServiceGone as error:
            _log.debug("drone %d: %s", self._node_id, error)

    def disconnect(self) -> None:
        """Close the connection and unregister the topic of the goals."""
        self._silent.drop(self._gps)
        self._gps.close()
        self._goal.unregister()

    def why_not_fly(self) -> str:
        """The world's reason: crashed, or battery empty. Empty if the drone can fly."""
        return self._why_not_fly()

    def set_goal(self, latitude: float, longitude: float, height: float) -> None:
        """Fly to this position (metres); the height is rounded to whole metres.

        Raises GoalRefused if the drone cannot fly, or obstacles block every path.
        """
        why_not = self._why_not_fly()
        if why_not:
            raise GoalRefused(f"the drone cannot fly: {why_not}")
        if self._obstacles is not None:
            self._check_path(self._obstacles, Location(latitude, longitude, height))
        self._goal.publish(location_msg(latitude, longitude, height))

    def _check_path(self, obstacles: Obstacles, goal: Location) -> None:
        try:
            start = self.get_location().to_vector()
        except LocationUnknown:
            return
        if obstacles.plan_flight(start, goal.to_vector(), 0.0, SPEED_M_S) is None:
            raise GoalRefused(NO_PATH)

    def get_location(self) -> Location:
        """The position that the engine reports. Raises LocationUnknown if it does not answer."""
        try:
            answer = self._ask()
        except (ServiceGone, ServiceRefused) as error:
            self._throttled_log.warning(f"drone {self._node_id} has no position", str(error))
            raise LocationUnknown(str(error)) from error
        return location_of(answer)

    def _ask(self) -> RequestGPSResponse:
        if self._silent.holds(self._gps):
            raise ServiceGone(f"{self._gps.name}: no answer")
        if not self._gps.is_connected():
            self._connect()
        try:
            return self._gps.call(RequestGPSRequest())
        except ServiceGone as error:
            self._silent.add(self._gps, error)
            raise

    def _connect(self) -> None:
        """Connect, without waiting while other engines are silent. Raises ServiceGone."""
        try:
            if self._silent:
                raise ServiceGone(f"{self._gps.name}: other engines do not answer")
            self._gps.connect()
        except ServiceGone as error:
            self._silent.add(self._gps, error)
            raise
