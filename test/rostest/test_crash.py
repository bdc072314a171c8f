#!/usr/bin/env python3
"""flight:=dynamic: two drones that change places meet in the air; all reports show the crash."""

from __future__ import annotations

import unittest

import rospy
import rostest
from diagnostic_msgs.msg import DiagnosticArray
from rostest_support import LogWatch, MeshWatch

from drone_mesh.msg import GroundedDrones, Location, MeshEvent, MeshState


class CrashTest(unittest.TestCase):
    def test_a_crash_is_an_event_and_part_of_state_and_diagnostics_and_ends_the_flights(
        self,
    ) -> None:
        rospy.init_node("test_crash")
        log, mesh = LogWatch(), MeshWatch(3)
        events: list[tuple[int, str, str]] = []
        states: list[MeshState] = []
        troubles: dict[str, str] = {}
        grounded: list[GroundedDrones] = []
        rospy.Subscriber(
            "/mesh/events", MeshEvent, lambda e: events.append((e.node, e.kind, e.detail))
        )
        rospy.Subscriber("/mesh/state", MeshState, states.append, queue_size=1)
        rospy.Subscriber("/Drones/grounded", GroundedDrones, grounded.append)
        rospy.Subscriber(
            "/diagnostics",
            DiagnosticArray,
            lambda array: troubles.update({s.name: s.message for s in array.status}),
        )
        mesh.wait("all connected", 60, mesh.connected)
        goals = {
            node: rospy.Publisher(f"/Drones/{node}/goal", Location, queue_size=1, latch=True)
            for node in (1, 2)
        }
        goals[1].publish(Location(latitude=0.0, longitude=6.0, height=0))
        goals[2].publish(Location(latitude=0.0, longitude=0.0, height=0))
        mesh.wait("a crash", 60, lambda: any(kind == "crashed" for _, kind, _ in events))
        node = next(node for node, kind, _ in events if kind == "crashed")
        mesh.wait("the crash in the state", 60, lambda: states[-1].nodes[node].crashed)
        self.assertEqual(states[-1].nodes[node].why_not_fly, "crashed")
        mesh.wait(
            "the crash in the diagnostics",
            60,
            lambda: troubles.get(f"drone_mesh: node {node}", "").startswith("crashed"),
        )
        mesh.wait("its host knows", 60, lambda: grounded and node in grounded[-1].ids)
        goals[node].publish(Location(latitude=3.0, longitude=3.0, height=0))
        mesh.wait(
            "a refused goal",
            60,
            lambda: (node, "goal refused", "the drone cannot fly: crashed") in events,
        )
        self.assertEqual(log.failures(), [])


if __name__ == "__main__":
    rostest.rosrun("drone_mesh", "crash", CrashTest)
