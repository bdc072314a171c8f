"""The engines of the drones, in whatever process they run, as the nodes see them."""

from __future__ import annotations

import contextlib
import logging
import struct
import threading
from typing import Any, Callable

import rospy

from drone_mesh.air.obstacles import Obstacles, no_path
from drone_mesh.drone.flight_path import SPEED_M_S, FlightPath, Vector
from drone_mesh.drone.interfaces import IDroneEngine
from drone_mesh.drone.location import Location
from drone_mesh.errors import GoalRefused, LocationUnknown
from drone_mesh.msg import GroundedDrones as GroundedDronesMsg
from drone_mesh.msg import Location as LocationMsg
from drone_mesh.ros.graph import names
from drone_mesh.ros.graph.conversions import NO_POSITION, location_msg, location_of
from drone_mesh.ros.graph.logs import ThrottledLog
from drone_mesh.ros.graph.periodic import Periodic
from drone_mesh.ros.graph.persistent_service import (
    PersistentService,
    ServiceGone,
    ServiceRefused,
    ServiceSilent,
)
from drone_mesh.ros.graph.simulation import Run, run_headers
from drone_mesh.srv import RequestGPS, RequestGPSRequest, RequestGPSResponse

ASK_AGAIN_AFTER_S = 1.0  # wall seconds
_ID_POSITION_SUB_BYTES = struct.Struct("<B3fI")  # how a DroneInfo begins on the wire

_log = logging.getLogger(__name__)

Gps = PersistentService[Any, Any]


class SilentEngines(Periodic):
    """Asks engines that did not answer again, in a thread of its own, since that may take seconds.

    Meanwhile nobody else uses their connections. One process may fly many drones: if it hangs, only
    the first of them costs the executor's worker its time. Any thread.
    """

    def __init__(self) -> None:
        super().__init__("silent engines", ASK_AGAIN_AFTER_S)
        self._lock = threading.Lock()
        # By the process that hangs, or else by the service that is not there.
        self._silent: dict[str, Gps] = {}

    def __len__(self) -> int:
        return len(self._silent)

    def holds(self, gps: Gps) -> bool:
        """Whether this engine, or the process that flies its drone, does not answer."""
        return gps.server in self._silent or gps.name in self._silent

    def add(self, gps: Gps, error: ServiceGone) -> None:
        """Ask this engine, which did not answer, again and again."""
        hangs = bool(gps.server) and isinstance(error, ServiceSilent)
        with self._lock:
            self._silent[gps.server if hangs else gps.name] = gps
        if hangs:
            _log.error("%s does not answer: its drones have no position", gps.server)

    def drop(self, gps: Gps) -> None:
        """Ask this engine no more, because its drone has ended."""
        with self._lock:
            self._silent = {key: other for key, other in self._silent.items() if other is not gps}

    def _work(self) -> None:
        for key, gps in list(self._silent.items()):
            try:
                gps.connect()
                gps.call(RequestGPSRequest())
            except ServiceRefused:
                pass
            except ServiceSilent:
                continue
            except ServiceGone as error:
                with self._lock:  # the process itself has ended, or answers
                    if self._silent.pop(key, None) is gps:
                        self._silent[gps.name] = gps
                _log.debug("%s", error)
                continue
            with self._lock:
                if self._silent.pop(key, None) is not gps:
                    gps.close()
                    continue
            if key != gps.name:
                _log.info("%s answers again", key)


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
        self._obstacles: Obstacles | None = None
        if obstacles is not None:
            self.keep_to(obstacles)
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

    def keep_to(self, obstacles: Obstacles) -> None:
        """Refuse goals that these boxes and this fence make unreachable."""
        self._obstacles, self.fence = obstacles, obstacles.fence

    def plan(self, start: Vector, goal: Vector, now_s: float) -> FlightPath | None:
        """Round the fence, if there is one."""
        if self._obstacles is None or not self.fence:
            return super().plan(start, goal, now_s)
        return self._obstacles.plan_flight(start, goal, now_s, SPEED_M_S)

    def connect(self) -> None:
        """Connect before the first request, so that the number of connections stays constant."""
        with contextlib.suppress(ServiceGone):
            self._connect()

    def disconnect(self) -> None:
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
            raise GoalRefused(no_path(self.fence))

    def get_location(self) -> Location:
        """The position that the engine reports. Raises LocationUnknown if it does not answer."""
        try:
            answer = self._ask()
        except (ServiceGone, ServiceRefused) as error:
            self._throttled_log.note(f"drone {self._node_id} has no position", str(error))
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


class GroundedDrones:
    """Subscribes: /Drones/grounded (GroundedDrones). Any thread may ask."""

    def __init__(self) -> None:
        self._reasons: dict[int, str] = {}  # replaced as a whole by rospy's thread
        self._subscriber = rospy.Subscriber(names.GROUNDED_TOPIC, GroundedDronesMsg, self._changed)

    def reason(self, node_id: int) -> str:
        """Why this drone cannot fly now; empty if it can, or if that is unknown."""
        return self._reasons.get(node_id, "")

    def stop(self) -> None:
        self._subscriber.unregister()

    def _changed(self, message: GroundedDronesMsg) -> None:
        self._reasons = dict(zip(message.ids, message.reasons))


class ReportedPlaces:
    """Subscribes: /WirelessSignalSimulator (DroneInfo). Any thread may ask.

    Reads only the beginning of each message: a fleet in flight sends thousands in a second.
    """

    def __init__(self) -> None:
        self._reported: dict[int, Vector] = {}  # rospy's thread replaces values, never the dict
        self._subscriber = rospy.Subscriber(
            names.SIGNAL_TOPIC, rospy.AnyMsg, self._heard, queue_size=names.SIGNAL_QUEUE
        )

    def place_of(self, node_id: int) -> Vector:
        """The last position, metres, that an engine reported for this drone; else NO_POSITION."""
        return self._reported.get(node_id, NO_POSITION)

    def _heard(self, message: rospy.AnyMsg) -> None:
        try:
            node_id, x, y, z, sub_bytes = _ID_POSITION_SUB_BYTES.unpack_from(message._buff)
        except struct.error:
            return
        if sub_bytes == 0 and (x, y, z) != NO_POSITION:
            self._reported[node_id] = (x, y, z)
