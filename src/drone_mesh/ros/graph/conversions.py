"""Between the package's own types and ROS messages."""

from __future__ import annotations

import rospy

from drone_mesh.drone.flight_path import Vector
from drone_mesh.drone.interfaces import Location
from drone_mesh.msg import DroneInfo
from drone_mesh.msg import Location as LocationMsg
from drone_mesh.srv import RequestGPSResponse


def ros_time(seconds: float) -> rospy.Time:
    """The nearest nanosecond; rospy.Time.from_sec rounds down: 0.94 s become 0.939999999."""
    return rospy.Time(0, round(seconds * 1e9))


def whole_metres(height: float) -> int:
    """A height as the int16 fields carry it."""
    return round(height)


def location_msg(latitude: float, longitude: float, height: float) -> LocationMsg:
    """A place (metres), its height rounded to whole metres."""
    return LocationMsg(latitude, longitude, whole_metres(height))


def gps_response(location: Location) -> RequestGPSResponse:
    """Where a drone's underside is."""
    return RequestGPSResponse(location.latitude, location.longitude, whole_metres(location.height))


def engine_info(node_id: int, position: Vector) -> DroneInfo:
    """The DroneInfo of an engine (docs/protocol.md, "Who speaks in DroneInfo")."""
    return DroneInfo(nodeID=node_id, position=position, sub="", on=True)
