"""Conversions between the package's own types and ROS messages, in both directions."""

from __future__ import annotations

from dataclasses import fields
from operator import attrgetter
from typing import Any, Protocol, Sequence

import rospy

from drone_mesh.communication.events.observer import MeshEventKind
from drone_mesh.drone.flight_path import Vector
from drone_mesh.drone.location import Location
from drone_mesh.formations.layouts import Order
from drone_mesh.formations.missions import Mission
from drone_mesh.msg import FenceArea, MeshState, NodeState, Obstacle
from drone_mesh.msg import Location as LocationMsg
from drone_mesh.msg import MeshEvent as MeshEventMsg
from drone_mesh.ros.graph import names
from drone_mesh.srv import FlyMissionRequest, OrderFormationRequest
from drone_mesh.state.model import AreaStatus, EventRecord, MeshStatus, NodeStatus, ObstacleStatus

_CODES = {kind.value: number for number, kind in enumerate(MeshEventKind)}  # as in MeshEvent.msg
_MESH_FIELDS = [field.name for field in fields(MeshStatus) if field.name != "stamp_s"]
_node_values = attrgetter(*(field.name for field in fields(NodeStatus)))
NO_POSITION: Vector = (0.0, 0.0, 0.0)  # of a DroneInfo that only speaks of power or topic


class PlaceMsg(Protocol):
    """Any message or request that carries a position."""

    latitude: float  # m, y
    longitude: float  # m, x
    height: int  # m, of the drone's underside


def ros_time(seconds: float) -> rospy.Time:
    """The time, to the nearest nanosecond: rospy.Time.from_sec makes 0.939999999 s of 0.94 s."""
    return rospy.Time(0, round(seconds * 1e9))


def location_of(message: PlaceMsg) -> Location:
    return Location(message.latitude, message.longitude, float(message.height))


def formation_request(
    name: str, orders: Sequence[Order], at_once: bool = False, gateways: Sequence[int] = ()
) -> OrderFormationRequest:
    """Asks the drone manager to send these drones, of gateways only `gateways`, to their places."""
    places = [location_msg(*goal) for _drone, goal in orders]
    drones = [drone for drone, _goal in orders]
    return OrderFormationRequest(name, drones, places, at_once, gateways)


def mission_request(mission: Mission) -> FlyMissionRequest:
    """Asks the pilot of a drone to fly this mission, at heights of whole metres."""
    places = [location_msg(y, x, height) for x, y, height in mission.waypoints]
    return FlyMissionRequest(FlyMissionRequest.FLY, places, mission.speed_m_s, mission.loop)


def location_msg(latitude: float, longitude: float, height: float) -> LocationMsg:
    """A position in metres, its height rounded to whole metres."""
    return LocationMsg(latitude, longitude, round(height))


def event_msg(event: EventRecord) -> MeshEventMsg:
    return MeshEventMsg(
        stamp=ros_time(event.stamp_s),
        node=event.node,
        code=_CODES[event.kind],
        kind=event.kind,
        peers=bytes(event.peers),
        detail=event.detail,
        order=event.order,
        place=[] if event.place is None else [location_msg(*event.place)],
    )


def event_record(message: MeshEventMsg) -> EventRecord:
    """The event in a message, or in one of an older definition, from a bag."""
    return EventRecord(
        message.stamp.to_sec(),
        message.node,
        message.kind,
        tuple(message.peers),
        message.detail,
        getattr(message, "order", 0),
        next(map(location_of, getattr(message, "place", ())), None),
    )


def state_msg(mesh: MeshStatus) -> MeshState:
    """The state as a message; nodes that already are messages are not copied."""
    message = MeshState(**_values(mesh, _MESH_FIELDS))
    message.nodes = [
        node if isinstance(node, NodeState) else NodeState(**_values(node, NodeState.__slots__))
        for node in mesh.nodes
    ]
    message.obstacles = [Obstacle(box.center, box.size, box.yaw) for box in mesh.obstacles]
    message.fence = [FenceArea(**vars(area)) for area in mesh.fence]
    message.header.stamp = ros_time(mesh.stamp_s)
    message.header.frame_id = names.MAP_FRAME
    return message


def mesh_status(message: MeshState) -> MeshStatus:
    """The state in a message.

    A message of an older definition, from a bag, gets defaults for the fields that it lacks.
    """
    values = _values(message, _MESH_FIELDS)
    if message._md5sum == MeshState._md5sum:
        values["nodes"] = [NodeStatus(*_node_values(node)) for node in message.nodes]
    else:
        values["nodes"] = [
            NodeStatus(**_values(node, NodeState.__slots__)) for node in message.nodes
        ]
    boxes = values.get("obstacles", ())
    values["obstacles"] = [ObstacleStatus(box.center, box.size, box.yaw) for box in boxes]
    areas = values.get("fence", ())
    values["fence"] = [AreaStatus(**_values(area, FenceArea.__slots__)) for area in areas]
    return MeshStatus(message.header.stamp.to_sec(), **values)


def _values(source: object, names: Sequence[str]) -> dict[str, Any]:
    """The fields of these names that the message has."""
    return {name: getattr(source, name) for name in names if hasattr(source, name)}
