"""MeshStatePublisher: merges the state of the whole mesh in the world's process.

The diagnostics: one summary, and one status per node with a problem.
"""

from __future__ import annotations

import math
import time
from collections import deque
from dataclasses import replace
from typing import Callable, Iterable, Mapping, Sequence, Tuple

import rospy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

from drone_mesh.communication.interfaces import NO_ROUTE
from drone_mesh.msg import GroundedDrones, HostReport, LayoutProgress, MeshEvent, MeshState
from drone_mesh.ros.graph import names
from drone_mesh.ros.graph.conversions import event_msg, ros_time, state_msg
from drone_mesh.ros.graph.periodic import HARDWARE_ID, Periodic
from drone_mesh.ros.graph.simulation import Run, is_left_behind, run_headers
from drone_mesh.state.condition import find_trouble, summarise
from drone_mesh.state.model import (
    EventRecord,
    MeshStatus,
    NodeStatus,
    channel_in_words,
    data_in_words,
)
from drone_mesh.state.observation import DroneView, MeshRoster, describe_drone
from drone_mesh.world.factory import VirtualDrone

WATCHED_PERIOD_S = 0.2  # wall time between two states with a subscriber: flights look smooth
UNWATCHED_PERIOD_S = 1.0  # and without one: the greatest age of the latched state
DIAGNOSTICS_PERIOD_S = 1.0
REPORTS_KEPT = 64  # of all hosts between two rounds; only the newest of each counts
EVENTS_QUEUE = 1000


WorldView = Tuple[MeshStatus, Sequence[DroneView]]
"""The world's share of one state: all but nodes, achieved factor and layouts; and the drones."""


class MeshStatePublisher(Periodic):
    """Merges the hosts' reports with the world's positions and flights.

    Subscribes: /mesh/reports (HostReport), /DroneManager/layouts (LayoutProgress)
    Publishes:  /mesh/state (MeshState, latched), 5 Hz while watched, else 1 Hz, of wall time
                /mesh/events (MeshEvent)
                /diagnostics (DiagnosticArray), 1 Hz
                /Drones/grounded (GroundedDrones, latched), when it changes

    rospy's handlers only put messages into queues; the object's thread owns everything else.
    """

    def __init__(
        self, run: Run, read_view: Callable[[], WorldView], happened: deque[EventRecord]
    ) -> None:
        """`run` is the world's: reports of another run do not count.

        `read_view` is called in the thread of this object and must not wait for the world.

        Any thread fills `happened` with events of the drones; this object empties it.
        """
        super().__init__("mesh state", WATCHED_PERIOD_S)
        self._world_run = run
        self._read_view = read_view
        self._roster = MeshRoster()
        self._reports: deque[tuple[HostReport, float]] = deque(maxlen=REPORTS_KEPT)
        self._forgotten: deque[int] = deque()
        self._last_state: tuple[float, float] | None = None  # wall, simulated
        self.latest: MeshStatus | None = None  # the last one; the next round changes its nodes
        self._published_s = self._diagnosed_s = float("-inf")
        self._state = rospy.Publisher(
            names.STATE_TOPIC, MeshState, headers=run_headers(run), queue_size=1, latch=True
        )
        self._events = rospy.Publisher(names.EVENTS_TOPIC, MeshEvent, queue_size=EVENTS_QUEUE)
        self._diagnostics = rospy.Publisher(names.DIAGNOSTICS_TOPIC, DiagnosticArray, queue_size=4)
        self._grounded = rospy.Publisher(
            names.GROUNDED_TOPIC, GroundedDrones, queue_size=1, latch=True
        )
        self._grounded_now: dict[int, str] = {}
        self._happened = happened
        self._progress: deque[LayoutProgress] = deque()
        self._layouts: dict[int, LayoutProgress] = {}  # by standing order
        self._subscribers = (
            rospy.Subscriber(names.REPORTS_TOPIC, HostReport, self._reported),
            rospy.Subscriber(names.LAYOUTS_TOPIC, LayoutProgress, self._progress.append),
        )

    def forget(self, node_id: int) -> None:
        """Stop showing this removed node, even if its host ended before. Any thread."""
        self._forgotten.append(node_id)

    def stop(self) -> None:
        for subscriber in self._subscribers:
            subscriber.unregister()
        super().stop()
        for publisher in (self._state, self._events, self._diagnostics, self._grounded):
            publisher.unregister()

    def _reported(self, report: HostReport) -> None:
        if not is_left_behind(report, self._world_run):
            self._reports.append((report, time.monotonic()))

    def _work(self) -> None:
        now_s = time.monotonic()
        self._merge()
        watched = self._state.get_num_connections() > 0
        if watched or now_s - self._published_s >= UNWATCHED_PERIOD_S:
            self._published_s = now_s
            self._publish(now_s)

    def _merge(self) -> None:
        while self._reports:
            report, heard_s = self._reports.popleft()
            self._roster.merge_report(report.host, report.nodes, heard_s)
            for event in report.events:
                self._events.publish(event)
        while self._forgotten:
            self._roster.forget(self._forgotten.popleft())
        while self._progress:  # what is over stays until there is other news
            progress = self._progress.popleft()
            self._layouts = {n: other for n, other in self._layouts.items() if not other.over}
            self._layouts[progress.id] = progress
        while self._happened:
            self._events.publish(event_msg(self._happened.popleft()))

    def _publish(self, now_s: float) -> None:
        world, drones = self._read_view()
        grounded = {drone.id: drone.why_not_fly for drone in drones if drone.why_not_fly}
        if grounded != self._grounded_now:
            self._grounded_now = grounded
            self._grounded.publish(GroundedDrones(list(grounded), list(grounded.values())))
        nodes, reliefs = self._roster.snapshot(drones, now_s), self._reliefs()
        for node in nodes:
            node.relieves = reliefs.get(node.id, NO_ROUTE)
        self.latest = mesh = replace(
            world,
            nodes=nodes,
            achieved_real_time_factor=self._achieved(now_s, world),
            layouts=[f"{p.name}: {p.message}" for p in self._layouts.values()],
        )
        self._state.publish(state_msg(mesh))
        if now_s - self._diagnosed_s >= DIAGNOSTICS_PERIOD_S:
            self._diagnosed_s = now_s
            self._diagnostics.publish(diagnostics_msg(mesh))

    def _reliefs(self) -> dict[int, int]:
        """By drone that comes: whose place it takes."""
        return {
            drone: progress.relieves
            for progress in self._layouts.values()
            if not progress.over
            for drones in (progress.arrived, progress.flying, progress.later, progress.waiting)
            for drone in drones
        }

    def _achieved(self, now_s: float, world: MeshStatus) -> float:
        before, self._last_state = self._last_state, (now_s, world.stamp_s)
        if before is None or world.paused:
            return 0.0
        return max(0.0, (world.stamp_s - before[1]) / (now_s - before[0]))


def drone_views(drones: Iterable[VirtualDrone], now_s: float) -> list[DroneView]:
    """The positions and flight paths of these drones. Any thread."""
    return [_view(drone, now_s) for drone in drones]


def _view(drone: VirtualDrone, now_s: float) -> DroneView:
    engine = drone.engine
    state, pilot, battery = engine.state, engine.pilot, engine.battery_percent()
    place = engine.get_location().to_vector()
    return replace(
        describe_drone(drone.node_id, drone.role, state.position, state.path, now_s),
        heading=() if pilot is None or state.path else pilot.heading or (),
        battery=math.nan if battery is None else battery,
        crashed=engine.crashed,
        why_not_fly=engine.why_not_fly(),
        mission="" if pilot is None else pilot.mission_in_words(place),
        endurance=engine.endurance(now_s),
    )


def diagnostics_msg(mesh: MeshStatus) -> DiagnosticArray:
    """One summary, and one entry for each node with a problem."""
    troubles = find_trouble(mesh.nodes)
    summary = summarise(mesh.nodes, troubles)
    by_id = {node.id: node for node in mesh.nodes}
    counts = {"nodes": len(mesh.nodes), "with trouble": len(troubles)}
    array = DiagnosticArray()
    array.header.stamp = ros_time(mesh.stamp_s)
    array.status = [
        _status(summary.severity, "mesh", summary.text, HARDWARE_ID, counts),
        *(
            _status(
                trouble.severity,
                f"node {trouble.node}",
                trouble.text,
                f"{HARDWARE_ID}_{trouble.node}",
                _details(by_id[trouble.node]),
            )
            for trouble in troubles
        ),
    ]
    return array


def _status(
    level: int, name: str, text: str, hardware: str, values: Mapping[str, object]
) -> DiagnosticStatus:
    pairs = [KeyValue(key, str(value)) for key, value in values.items()]
    return DiagnosticStatus(level, f"drone_mesh: {name}", text, hardware, pairs)


def _details(node: NodeStatus) -> dict[str, object]:
    return {
        "on": node.on,
        "connected": node.connected,
        "hops": node.hops,
        "neighbours": " ".join(map(str, node.neighbours)),
        "route": " ".join(map(str, node.route)),
        "repair": node.repair,
        "radio channel": channel_in_words(node),
        "users' data": data_in_words(node),
    }
