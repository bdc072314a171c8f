"""The node /mesh_markers: the mesh for rviz, as tf frames and one topic of markers."""

from __future__ import annotations

import contextlib
import queue
import time
from typing import Callable

import rospy
from geometry_msgs.msg import TransformStamped
from tf2_msgs.msg import TFMessage
from visualization_msgs.msg import MarkerArray

from drone_mesh.msg import MeshState
from drone_mesh.ros.graph import names
from drone_mesh.ros.graph.command_line import start_node
from drone_mesh.ros.graph.logs import show_library_logs_on_rosout
from drone_mesh.ros.graph.master import MasterWatch
from drone_mesh.ros.views.markers import MarkerMaker
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
        self._sent: rospy.Time | None = None  # the stamp of the latest frames
        self._new_viewers, self._new_listeners = _Newcomers(), _Newcomers()
        self._markers = rospy.Publisher(
            names.MARKERS_TOPIC, MarkerArray, subscriber_listener=self._new_viewers, queue_size=10
        )
        self._frames = rospy.Publisher(
            names.TF_TOPIC, TFMessage, subscriber_listener=self._new_listeners, queue_size=10
        )
        rospy.Subscriber(names.STATE_TOPIC, MeshState, self._show, queue_size=1)

    def _show(self, state: MeshState) -> None:
        stamp, newcomers = state.header.stamp, self._new_listeners.drain()
        frames = TFMessage(
            [_transform(node, stamp) for node in state.nodes if position_is_known(node)]
        )
        # Once per stamp: tf2 warns about a second one, and a paused simulation has but one.
        if stamp != self._sent:
            self._sent = stamp
            self._frames.publish(frames)
        else:
            for send in newcomers:
                send(frames)
        if self._markers.get_num_connections() == 0:
            return
        if self._new_viewers.drain():
            self._maker.forget_shown()
        markers = self._maker.markers(state, time.monotonic())
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


def _transform(node: NodeStatus, stamp: rospy.Time) -> TransformStamped:
    message = TransformStamped(child_frame_id=names.drone_frame(node.id))
    message.header.frame_id = names.MAP_FRAME
    message.header.stamp = stamp
    translation, rotation = message.transform.translation, message.transform.rotation
    translation.x, translation.y, translation.z = node.position
    rotation.w = 1.0  # upright
    return message


def main() -> None:
    start_node(MeshMarkers.__doc__, "mesh_markers")
    show_library_logs_on_rosout()
    MeshMarkers()
    MasterWatch().start()
    rospy.spin()
