"""FenceService: changes the fence of the running simulation (docs/ros.md, "Drone manager")."""

from __future__ import annotations

import logging
import threading

import rospy
from std_msgs.msg import String

from drone_mesh import srv
from drone_mesh.earth_files.plan import MAX_PLAN_CHARACTERS
from drone_mesh.errors import ConfigurationError
from drone_mesh.fence_file import Row, areas_in, areas_json, changed_rows, fence_in, rows_of_text
from drone_mesh.ros.graph import names
from drone_mesh.ros.graph.fleet_parameter import get_fleet_parameter
from drone_mesh.ros.graph.parameters import earth_origin, fence_areas

_log = logging.getLogger(__name__)


class FenceService:
    """Service: /DroneManager/setFence (SetFence).

    Publishes: /DroneManager/fence (String, latched): the areas as JSON, once they have changed
    Parameter: /drone_mesh/fence, the same, for what starts later; set by the world at its start,
    which restores it after a restart of the master
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()  # one change at a time
        self._publisher = rospy.Publisher(names.FENCE_TOPIC, String, queue_size=10, latch=True)
        rospy.Service(names.SET_FENCE_SERVICE, srv.SetFence, self._set)

    def _set(self, request: srv.SetFenceRequest) -> srv.SetFenceResponse:
        with self._lock:
            try:
                areas = areas_json(self._areas(request))
                fence = fence_in(areas)
            except ConfigurationError as error:
                raise rospy.ServiceException(str(error)) from error
            except KeyError:
                raise rospy.ServiceException("no simulation is running") from None
            rospy.set_param(names.FENCE_PARAM, areas)
            self._publisher.publish(areas)
        words = f"fence: {fence.names or 'none'}"
        _log.info("%s", words)
        return srv.SetFenceResponse(words)

    def _areas(self, request: srv.SetFenceRequest) -> list[Row]:
        """The areas that hold from now on. Raises ConfigurationError; KeyError without a world."""
        fleet = get_fleet_parameter()
        if fleet.mobility != "none":
            raise ConfigurationError("mobility does not go with a fence: its models know none")
        if len(request.areas) > MAX_PLAN_CHARACTERS:
            raise ConfigurationError(f"longer than {MAX_PLAN_CHARACTERS} characters")
        is_empty = request.areas.strip() in ("", areas_json([]))
        read = [] if is_empty else rows_of_text(request.areas, "areas", earth_origin(""))
        if not request.keep:
            if request.remove:  # instead of all areas
                raise ConfigurationError("remove goes with keep: true")
            return read
        return changed_rows(areas_in(fence_areas(fleet)), read, request.remove)
