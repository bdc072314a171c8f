"""MeshStatePublisher: the state of the whole mesh, put together in the process of the world."""

from __future__ import annotations

import threading
import time
from collections import deque
from dataclasses import dataclass
from typing import Callable, Iterable, Sequence

import rospy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

from drone_mesh.msg import HostReport, MeshEvent, MeshState, NodeState
from drone_mesh.ros.graph import names
from drone_mesh.ros.graph.conversions import ros_time
from drone_mesh.state.model import MeshStatus, NodeStatus
from drone_mesh.state.roster import DroneView, MeshRoster
from drone_mesh.state.trouble import Trouble, find_trouble, summarise

WATCHED_PERIOD_S = 0.2  # wall time between two states while somebody looks: flights look smooth
UNWATCHED_PERIOD_S = 1.0  # and while nobody does: the latched state is this old at most
DIAGNOSTICS_PERIOD_S = 1.0
REPORTS_KEPT = 64  # several hosts' reports between two looks; the newest of each one counts
EVENTS_QUEUE = 1000
HARDWARE_ID = "drone_mesh"


@dataclass(frozen=True)
class WorldView:
    """What the world tells for one state."""

    stamp_s: float
    drones: Iterable[DroneView]
    real_time_factor: float
    paused: bool


class MeshStatePublisher:
    """Merges the hosts' reports with what the world sees.

    Subscribes: /mesh/reports (HostReport)
    Publishes:  /mesh/state (MeshState, latched), 5 Hz while watched, else 1 Hz, of wall time
                /mesh/events (MeshEvent)
                /diagnostics (DiagnosticArray), 1 Hz

    Handlers of rospy only put reports into a queue; all else belongs to the one thread.
    """

    def __init__(self, look: Callable[[], WorldView], max_distance_m: float) -> None:
        """`look` is called in the thread of this object, and must not wait for the world."""
        self._look = look
        self._max_distance_m = max_distance_m
        self._roster = MeshRoster()
        self._reports: deque[tuple[HostReport, float]] = deque(maxlen=REPORTS_KEPT)
        self._last_look: tuple[float, float] | None = None  # wall, simulated
        self._latest: MeshStatus | None = None
        self._told_trouble_s = float("-inf")
        self._state = rospy.Publisher(names.STATE_TOPIC, MeshState, queue_size=1, latch=True)
        self._events = rospy.Publisher(names.EVENTS_TOPIC, MeshEvent, queue_size=EVENTS_QUEUE)
        self._diagnostics = rospy.Publisher(names.DIAGNOSTICS_TOPIC, DiagnosticArray, queue_size=4)
        self._stopped = threading.Event()
        self._thread = threading.Thread(target=self._run, name="mesh state", daemon=True)
        self._subscriber = rospy.Subscriber(names.REPORTS_TOPIC, HostReport, self._reported)

    @property
    def latest(self) -> MeshStatus | None:
        """What was published last; None before the first time. Its nodes change with the next."""
        return self._latest

    def start(self) -> None:
        """Begin to publish."""
        self._thread.start()

    def stop(self) -> None:
        """Publish no more; returns when the thread has ended."""
        self._subscriber.unregister()
        self._stopped.set()
        self._thread.join()
        for publisher in (self._state, self._events, self._diagnostics):
            publisher.unregister()

    def _reported(self, report: HostReport) -> None:
        self._reports.append((report, time.monotonic()))

    def _run(self) -> None:
        published_s = float("-inf")
        while not (self._stopped.wait(WATCHED_PERIOD_S) or rospy.is_shutdown()):
            now_s = time.monotonic()
            try:
                self._merge()
                watched = self._state.get_num_connections() > 0
                if watched or now_s - published_s >= UNWATCHED_PERIOD_S:
                    published_s = now_s
                    self._publish(now_s)
            except rospy.ROSException:  # what publishing raises while the node shuts down
                if not rospy.is_shutdown():
                    raise

    def _merge(self) -> None:
        while self._reports:
            report, heard_s = self._reports.popleft()
            self._roster.merge_report(report.host, report.nodes, heard_s)
            for event in report.events:
                self._events.publish(event)

    def _publish(self, now_s: float) -> None:
        view = self._look()
        nodes = self._roster.snapshot(view.drones, now_s)
        mesh = MeshStatus(
            view.stamp_s,
            nodes,
            self._max_distance_m,
            view.real_time_factor,
            self._achieved(now_s, view),
            view.paused,
        )
        self._latest = mesh
        self._state.publish(state_message(mesh))
        if now_s - self._told_trouble_s >= DIAGNOSTICS_PERIOD_S:
            self._told_trouble_s = now_s
            self._diagnostics.publish(diagnostics_message(mesh))

    def _achieved(self, now_s: float, view: WorldView) -> float:
        before, self._last_look = self._last_look, (now_s, view.stamp_s)
        if before is None or view.paused:
            return 0.0
        return max(0.0, (view.stamp_s - before[1]) / (now_s - before[0]))


def state_message(mesh: MeshStatus) -> MeshState:
    """The message; its nodes that are messages already are taken as they are."""
    message = MeshState(
        max_distance=mesh.max_distance,
        real_time_factor=mesh.real_time_factor,
        achieved_real_time_factor=mesh.achieved_real_time_factor,
        paused=mesh.paused,
        nodes=[node if isinstance(node, NodeState) else _node_message(node) for node in mesh.nodes],
    )
    message.header.stamp = ros_time(mesh.stamp_s)
    message.header.frame_id = names.MAP_FRAME
    return message


def mesh_status(message: MeshState) -> MeshStatus:
    """The other way round: its nodes are those of the message."""
    return MeshStatus(
        message.header.stamp.to_sec(),
        message.nodes,
        message.max_distance,
        message.real_time_factor,
        message.achieved_real_time_factor,
        message.paused,
    )


def diagnostics_message(mesh: MeshStatus) -> DiagnosticArray:
    """One summary, and one entry for each node with trouble."""
    troubles = find_trouble(mesh.nodes)
    summary = summarise(mesh.nodes, troubles)
    by_id = {node.id: node for node in mesh.nodes}
    array = DiagnosticArray()
    array.header.stamp = ros_time(mesh.stamp_s)
    array.status.append(
        DiagnosticStatus(
            level=summary.severity,
            name="drone_mesh: mesh",
            message=summary.text,
            hardware_id=HARDWARE_ID,
            values=_values({"nodes": len(mesh.nodes), "with trouble": len(troubles)}),
        )
    )
    array.status += [_trouble_status(trouble, by_id[trouble.node]) for trouble in troubles]
    return array


def _trouble_status(trouble: Trouble, node: NodeStatus) -> DiagnosticStatus:
    return DiagnosticStatus(
        level=trouble.severity,
        name=f"drone_mesh: node {trouble.node}",
        message=trouble.text,
        hardware_id=f"{HARDWARE_ID}_{trouble.node}",
        values=_values(
            {
                "on": node.on,
                "connected": node.connected,
                "hops": node.hops,
                "neighbours": _in_words(node.neighbours),
                "route": _in_words(node.route),
            }
        ),
    )


def _in_words(ids: Sequence[int]) -> str:
    return " ".join(map(str, ids))


def _values(values: dict[str, object]) -> list[KeyValue]:
    return [KeyValue(key, str(value)) for key, value in values.items()]


def _node_message(node: NodeStatus) -> NodeState:
    return NodeState(**{name: getattr(node, name) for name in NodeState.__slots__})
