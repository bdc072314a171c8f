"""The node /mesh_markers: the mesh for rviz, as tf frames and one topic of markers."""

from __future__ import annotations

import contextlib
import queue
import time
from typing import Callable, Iterable

import rospy
from geometry_msgs.msg import TransformStamped
from tf2_msgs.msg import TFMessage
from visualization_msgs.msg import MarkerArray

from drone_mesh.msg import MeshState
from drone_mesh.ros.graph import names
from drone_mesh.ros.graph.command_line import start_node
from drone_mesh.ros.graph.logs import show_library_logs_on_rosout
from drone_mesh.ros.graph.master_watch import MasterWatch
from drone_mesh.ros.views.markers import MarkerMaker
from drone_mesh.ros.views.moved_frames import MovedFrames
from drone_mesh.state.model import NodeStatus, position_is_known

Send = Callable[[object], None]


class MeshMarkers:
    """Shows the mesh in rviz.

    Subscribes: /mesh/state (MeshState)
    Publishes:  /mesh/markers (MarkerArray), /tf (TFMessage); both at most once per state
    """

    # The subscriber's thread does the work; the other threads of rospy only announce newcomers.

    def __init__(self) -> None:
        self._maker = MarkerMaker()
        self._moved = MovedFrames()
        self._new_viewers, self._new_listeners = _Newcomers(), _Newcomers()
        self._markers = rospy.Publisher(
            names.MARKERS_TOPIC, MarkerArray, subscriber_listener=self._new_viewers, queue_size=10
        )
        self._frames = rospy.Publisher(
            names.TF_TOPIC, TFMessage, subscriber_listener=self._new_listeners, queue_size=10
        )
        rospy.Subscriber(names.STATE_TOPIC, MeshState, self._show, queue_size=1)

    def _show(self, state: MeshState) -> None:
        now_s = time.monotonic()
        stamp = state.header.stamp
        newcomers = self._new_listeners.drain()
        moved = self._moved.select(state.nodes, stamp.to_sec(), now_s)
        if moved:
            self._frames.publish(_frames(moved, stamp))
        if newcomers:  # earlier subscribers have these frames already, perhaps with the same stamp
            sent = {node.id for node in moved}
            known = [node for node in state.nodes if position_is_known(node)]
            rest = _frames([node for node in known if node.id not in sent], stamp)
            for send in newcomers:
                send(rest)
        if self._markers.get_num_connections() == 0:
            return
        if self._new_viewers.drain():
            self._maker.forget_shown()
        markers = self._maker.markers(state, now_s)
        if markers.markers:
            self._markers.publish(markers)


class _Newcomers(rospy.SubscribeListener):
    """New subscribers of a topic, each as the function that sends to it alone."""

    def __init__(self) -> None:
        super().__init__()
        self._new: queue.SimpleQueue[Send] = queue.SimpleQueue()

    def peer_subscribe(self, _topic: str, _send_to_all: Send, send: Send) -> None:
        self._new.put(send)

    def drain(self) -> list[Send]:
        """The subscribers that came since the last call."""
        taken = []
        with contextlib.suppress(queue.Empty):
            while True:
                taken.append(self._new.get_nowait())
        return taken


def _frames(nodes: Iterable[NodeStatus], stamp: rospy.Time) -> TFMessage:
    return TFMessage(transforms=[_transform(node, stamp) for node in nodes])


def _transform(node: NodeStatus, stamp: rospy.Time) -> TransformStamped:
    message = TransformStamped(child_frame_id=names.drone_frame(node.id))
    message.header.frame_id = names.MAP_FRAME
    message.header.stamp = stamp
    translation, rotation = message.transform.translation, message.transform.rotation
    translation.x, translation.y, translation.z = node.position
    rotation.w = 1.0  # upright
    return message


def main() -> None:
    """Run the node."""
    start_node(MeshMarkers.__doc__, "mesh_markers")
    show_library_logs_on_rosout()
    MeshMarkers()
    MasterWatch().start()
    rospy.spin()
