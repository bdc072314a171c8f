"""The node /mesh_markers: the mesh for rviz, as tf frames and one topic of markers."""

from __future__ import annotations

import threading
import time

import rospy
from geometry_msgs.msg import TransformStamped
from tf2_msgs.msg import TFMessage
from visualization_msgs.msg import MarkerArray

from drone_mesh.msg import MeshState
from drone_mesh.ros.graph import names
from drone_mesh.ros.graph.command_line import prepare_node
from drone_mesh.ros.graph.logs import show_library_logs_on_rosout
from drone_mesh.ros.graph.master_watch import MasterWatch
from drone_mesh.ros.views.markers import MarkerMaker
from drone_mesh.state.model import NodeStatus, position_is_known

ALL_FRAMES_PERIOD_S = 1.0  # wall time; period of the frames of drones that do not move
_UPRIGHT = (0.0, 0.0, 0.0, 1.0)  # x y z w


class MeshMarkers:
    """Shows the mesh in rviz.

    Subscribes: /mesh/state (MeshState)
    Publishes:  /mesh/markers (MarkerArray), /tf (TFMessage); both at most as often as the state
    """

    # The subscriber's thread does the work; the other threads of rospy only set `_newcomer`.

    def __init__(self) -> None:
        self._maker = MarkerMaker()
        self._framed: dict[int, tuple[float, ...]] = {}
        self._all_framed_s = float("-inf")
        self._newcomer = threading.Event()
        listener = _Newcomers(self._newcomer)
        self._markers = rospy.Publisher(
            names.MARKERS_TOPIC, MarkerArray, subscriber_listener=listener, queue_size=10
        )
        self._frames = rospy.Publisher("/tf", TFMessage, queue_size=10)
        rospy.Subscriber(names.STATE_TOPIC, MeshState, self._show, queue_size=1)

    def _show(self, state: MeshState) -> None:
        now_s = time.monotonic()
        frames = self._moved_frames(state, now_s)
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

    def _moved_frames(self, state: MeshState, wall_s: float) -> TFMessage:
        """Frames map -> drone_<id> of drones that moved; of all once per ALL_FRAMES_PERIOD_S."""
        if wall_s - self._all_framed_s >= ALL_FRAMES_PERIOD_S:
            self._all_framed_s = wall_s
            self._framed.clear()
        message = TFMessage()
        for node in state.nodes:
            position = tuple(node.position)
            if position_is_known(node) and self._framed.get(node.id) != position:
                self._framed[node.id] = position
                message.transforms.append(_transform(node, state.header.stamp))
        return message


class _Newcomers(rospy.SubscribeListener):
    def __init__(self, came: threading.Event) -> None:
        super().__init__()
        self._came = came

    def peer_subscribe(self, *_args: object) -> None:
        self._came.set()


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
    MasterWatch().start()
    rospy.spin()
