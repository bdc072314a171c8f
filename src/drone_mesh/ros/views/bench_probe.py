"""The benchmark's probe: a ROS node that writes its observations to standard output."""

from __future__ import annotations

import sys
import threading
import time

import rospy
from diagnostic_msgs.msg import DiagnosticArray

from drone_mesh.bench.observation import (
    CONNECTED,
    DISCONNECTED,
    PROBE,
    REST,
    STARTED,
    TAKE_OFF,
    WATCH,
    Figures,
    Happening,
    Sight,
    StateSample,
    to_line,
)
from drone_mesh.msg import Location, MeshEvent, MeshState, NodeState
from drone_mesh.ros.graph import names

FLIGHT_M = 300.0  # our choice: at 2 m/s it lasts longer than a measurement
_KINDS = (STARTED, CONNECTED, DISCONNECTED)


class Probe:
    """Subscribes: /mesh/state (MeshState), /mesh/events (MeshEvent), /diagnostics (DiagnosticArray)

    Watches the state only on request, because publishing it five times a second costs time. Runs on
    wall time. rospy's threads call the handlers; `_lock` keeps their output lines whole.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._watching: rospy.Subscriber | None = None
        self._seen = MeshState()
        self._goals: list[rospy.Publisher] = []
        rospy.Subscriber(names.EVENTS_TOPIC, MeshEvent, self._event)
        rospy.Subscriber(names.DIAGNOSTICS_TOPIC, DiagnosticArray, self._diagnostics)
        self._print(Figures(PROBE, time.monotonic()))

    def obey(self, order: str) -> None:
        """Carry out an order: start or stop watching the state, or start the flights."""
        if order == WATCH and self._watching is None:
            self._watching = rospy.Subscriber(names.STATE_TOPIC, MeshState, self._state)
        elif order == REST and self._watching is not None:
            self._watching.unregister()
            self._watching = None
        elif order == TAKE_OFF:
            self._take_off()

    def _take_off(self) -> None:
        """Send all drones far away, in parallel, bypassing the DroneManager and the mesh."""
        for node in self._seen.nodes:
            topic = names.goal_topic(node.id)
            goal = rospy.Publisher(topic, Location, queue_size=1, latch=True)
            x, y, _ = node.position
            goal.publish(Location(latitude=y + FLIGHT_M, longitude=x, height=0))
            self._goals.append(goal)

    def _state(self, mesh: MeshState) -> None:
        self._seen = mesh
        on = [node for node in mesh.nodes if node.on]
        routers = [node for node in on if node.role == NodeState.ROUTER]
        self._print(
            StateSample(
                wall_s=time.monotonic(),
                sim_s=mesh.header.stamp.to_sec(),
                on=len(on),
                connected=sum(node.connected for node in routers),
                messages=sum(node.total_messages for node in mesh.nodes),
                flying=sum(len(node.path) > 0 for node in mesh.nodes),
                links=sum(len(node.neighbours) for node in on) // 2,
            )
        )

    def _event(self, event: MeshEvent) -> None:
        if event.kind in _KINDS:
            self._print(Happening(event.stamp.to_sec(), event.node, event.kind))

    def _diagnostics(self, array: DiagnosticArray) -> None:
        for status in array.status:
            values = {}
            for pair in status.values:
                try:
                    values[pair.key] = float(pair.value)
                except ValueError:
                    continue  # text
            self._print(Figures(status.name, time.monotonic(), values))

    def _print(self, sight: Sight) -> None:
        with self._lock:
            print(to_line(sight), flush=True)


def main() -> None:
    """Run until the orders on standard input end."""
    rospy.init_node(PROBE, disable_signals=True)
    probe = Probe()
    for line in sys.stdin:
        probe.obey(line.strip())
    rospy.signal_shutdown("the benchmark is done")


if __name__ == "__main__":
    main()
