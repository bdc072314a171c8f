"""The node /mesh_markers: the mesh for rviz, as tf frames and one topic of markers."""

from __future__ import annotations

import threading
import time
from typing import Iterable, Sequence

import rospy
from geometry_msgs.msg import Point, TransformStamped
from std_msgs.msg import ColorRGBA
from tf2_msgs.msg import TFMessage
from visualization_msgs.msg import Marker, MarkerArray

from drone_mesh.drone.roles import Role
from drone_mesh.msg import MeshState
from drone_mesh.ros.graph import names
from drone_mesh.ros.graph.command_line import prepare_node
from drone_mesh.ros.graph.logs import show_library_logs_on_rosout
from drone_mesh.state.links import Link, LostLinks, known_links, shortest, way_links
from drone_mesh.state.model import NodeStatus, position_is_known

ALL_FRAMES_PERIOD_S = 1.0  # wall time; a drone that stands still is told of no more often
MOST_KNOWN_LINKS = 1500  # our choice: 254 drones on 1 m have 18,000, which are one blot
BOX_M = {Role.ROUTER: (0.5, 0.5, 0.25), Role.GATEWAY: (0.5, 0.5, 0.5)}  # larger than life
LABEL_M = 0.5
_UPRIGHT = (0.0, 0.0, 0.0, 1.0)  # x y z w

CONNECTED = ColorRGBA(0.16, 0.65, 0.27, 1.0)
LOST = ColorRGBA(0.85, 0.15, 0.12, 1.0)
OFF = ColorRGBA(0.55, 0.58, 0.62, 1.0)
FLYING = ColorRGBA(0.95, 0.60, 0.10, 1.0)
GATEWAY = ColorRGBA(0.56, 0.20, 0.75, 1.0)
LABEL = ColorRGBA(1.0, 1.0, 1.0, 1.0)
KNOWN = ColorRGBA(0.60, 0.66, 0.74, 0.35)


def node_colour(node: NodeStatus) -> ColorRGBA:
    """By role and state."""
    if not node.on:
        return OFF
    if len(node.path):
        return FLYING
    if node.role == Role.GATEWAY:
        return GATEWAY
    return CONNECTED if node.connected else LOST


class MarkerMaker:
    """Makes markers and frames of states; of markers only those that changed. One thread."""

    def __init__(self) -> None:
        self._shown: dict[tuple[str, int], object] = {}
        self._lost = LostLinks()
        self._frames: dict[int, tuple[float, ...]] = {}
        self._all_frames_s = float("-inf")

    def forget_shown(self) -> None:
        """Somebody new looks: the next markers are all of them."""
        self._shown.clear()

    def frames(self, state: MeshState, wall_s: float) -> TFMessage:
        """map -> drone_<id>, of drones that moved, and now and then of all."""
        if wall_s - self._all_frames_s >= ALL_FRAMES_PERIOD_S:
            self._all_frames_s = wall_s
            self._frames.clear()
        message = TFMessage()
        for node in state.nodes:
            place = tuple(node.position)
            if position_is_known(node) and self._frames.get(node.id) != place:
                self._frames[node.id] = place
                message.transforms.append(_transform(node, state.header.stamp))
        return message

    def markers(self, state: MeshState, wall_s: float) -> MarkerArray:
        """What changed since the last call."""
        nodes = [node for node in state.nodes if position_is_known(node)]
        known, ways = known_links(nodes), way_links(nodes)
        array = MarkerArray()
        for role, size in BOX_M.items():
            self._add_boxes(array, [node for node in nodes if node.role == role], role, size)
        lost = shortest(set(self._lost.update(known, wall_s)), nodes, MOST_KNOWN_LINKS)
        unused = shortest(known - ways, nodes, MOST_KNOWN_LINKS)
        self._add_links(array, "links: way to a gateway", nodes, sorted(ways), CONNECTED, 0.08)
        self._add_links(array, "links: known", nodes, unused, KNOWN, 0.03)
        self._add_links(array, "links: just lost", nodes, lost, LOST, 0.05)
        self._add_flights(array, nodes)
        self._add_labels(array, nodes)
        for marker in array.markers:
            marker.header.stamp, marker.header.frame_id = state.header.stamp, names.MAP_FRAME
        return array

    def _add_boxes(
        self, array: MarkerArray, nodes: Sequence[NodeStatus], role: Role, size: Sequence[float]
    ) -> None:
        points = [_point(node.position, up=size[2] / 2) for node in nodes]
        content = [(tuple(node.position), id(node_colour(node))) for node in nodes]
        marker = self._changed(array, f"{role.name.lower()}s", 0, content)
        if marker:
            marker.type = Marker.CUBE_LIST
            marker.scale.x, marker.scale.y, marker.scale.z = size
            marker.points = points
            marker.colors = [node_colour(node) for node in nodes]

    def _add_links(
        self, array: MarkerArray, name: str, nodes: Sequence[NodeStatus], links: Iterable[Link],
        colour: ColorRGBA, width_m: float,
    ) -> None:  # fmt: skip
        places = {node.id: tuple(node.position) for node in nodes}
        lines = [(places[a], places[b]) for a, b in links]
        self._add_lines(array, name, lines, colour, width_m)

    def _add_flights(self, array: MarkerArray, nodes: Sequence[NodeStatus]) -> None:
        lines = []
        for node in nodes:
            corners = [tuple(node.position), *zip(*[iter(node.path)] * 3)]
            lines += list(zip(corners, corners[1:]))
        self._add_lines(array, "flights", lines, FLYING, 0.06)

    def _add_lines(
        self, array: MarkerArray, name: str, lines: Sequence[tuple[Sequence[float], ...]],
        colour: ColorRGBA, width_m: float,
    ) -> None:  # fmt: skip
        marker = self._changed(array, name, 0, lines)
        if marker:
            marker.type = Marker.LINE_LIST
            marker.scale.x = width_m
            marker.color = colour
            marker.points = [_point(end, up=0.05) for line in lines for end in line]

    def _add_labels(self, array: MarkerArray, nodes: Sequence[NodeStatus]) -> None:
        for node in nodes:
            marker = self._changed(array, "ids", node.id, [tuple(node.position)])
            if marker:
                marker.type = Marker.TEXT_VIEW_FACING
                marker.scale.z = LABEL_M
                marker.color = LABEL
                marker.text = str(node.id)
                box_m = BOX_M[Role(node.role)][2]
                marker.pose.position = _point(node.position, up=box_m + 1.2 * LABEL_M)
        there = {node.id for node in nodes}
        for name, number in [key for key in self._shown if key[0] == "ids"]:
            if number not in there:
                self._changed(array, name, number, [])

    def _changed(
        self, array: MarkerArray, name: str, number: int, content: Sequence[object]
    ) -> Marker | None:
        """A new marker to fill in, if `content` is not what is shown; without content it goes."""
        key = (name, number)
        if self._shown.get(key, []) == content:
            return None
        self._shown[key] = content
        marker = Marker(ns=name, id=number)
        marker.pose.orientation.w = 1.0
        array.markers.append(marker)
        if not content:
            del self._shown[key]
            marker.action = Marker.DELETE
            return None
        return marker


class MeshMarkers:
    """Subscribes: /mesh/state (MeshState)
    Publishes:  /mesh/markers (MarkerArray), /tf (TFMessage); both at most as often as the state

    The subscriber's thread does the work; rospy's others only set `_newcomer`.
    """

    def __init__(self) -> None:
        self._maker = MarkerMaker()
        self._newcomer = threading.Event()
        listener = _Newcomers(self._newcomer)
        self._markers = rospy.Publisher(
            names.MARKERS_TOPIC, MarkerArray, subscriber_listener=listener, queue_size=10
        )
        self._frames = rospy.Publisher("/tf", TFMessage, queue_size=10)
        rospy.Subscriber(names.STATE_TOPIC, MeshState, self._show, queue_size=1)

    def _show(self, state: MeshState) -> None:
        now_s = time.monotonic()
        frames = self._maker.frames(state, now_s)
        if frames.transforms:
            self._frames.publish(frames)
        if self._markers.get_num_connections() == 0:
            return
        if self._newcomer.is_set():
            self._newcomer.clear()
            self._maker.forget_shown()
        markers = self._maker.markers(state, now_s)
        if markers.markers:
            self._markers.publish(markers)


class _Newcomers(rospy.SubscribeListener):
    def __init__(self, came: threading.Event) -> None:
        super().__init__()
        self._came = came

    def peer_subscribe(self, *_args: object) -> None:
        self._came.set()


def _point(place: Sequence[float], up: float) -> Point:
    return Point(place[0], place[1], place[2] + up)


def _transform(node: NodeStatus, stamp: rospy.Time) -> TransformStamped:
    message = TransformStamped(child_frame_id=names.drone_frame(node.id))
    message.header.frame_id = names.MAP_FRAME
    message.header.stamp = stamp
    translation, rotation = message.transform.translation, message.transform.rotation
    translation.x, translation.y, translation.z = node.position
    rotation.x, rotation.y, rotation.z, rotation.w = _UPRIGHT
    return message


def main() -> None:
    """Run the node."""
    prepare_node(MeshMarkers.__doc__)
    rospy.init_node("mesh_markers")
    show_library_logs_on_rosout()
    MeshMarkers()
    rospy.spin()
