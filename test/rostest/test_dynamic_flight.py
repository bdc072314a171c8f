#!/usr/bin/env python3
"""flight:=dynamic: physics moves the drones in a wind; they carry out orders, or meet in the air.

All reports show a crash of two drones that change places.
"""

from __future__ import annotations

import unittest

import rospy
import rostest
from diagnostic_msgs.msg import DiagnosticArray
from rostest_support import LogWatch, MeshWatch, call

from drone_mesh.msg import GroundedDrones, Location, MeshEvent, MeshState
from drone_mesh.srv import RequestDroneFlight


class DynamicFlightTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls) -> None:
        rospy.init_node("test_dynamic_flight")
        cls.log, cls.mesh = LogWatch(), MeshWatch(4)

    def test_1_an_order_is_flown_against_the_wind_and_the_mesh_is_whole_again(self) -> None:
        log, mesh = self.log, self.mesh
        mesh.wait("all connected at the start", 60, mesh.connected)
        call("/DroneManager/requestDroneMovement", RequestDroneFlight, 3, 4.0, 8.0, 0)
        mesh.wait(
            "drone 3 within half a metre of its goal, on the ground",
            90,
            lambda: self._is_near(mesh.place(3), (8.0, 4.0)),
        )
        mesh.wait("connected again", 60, mesh.connected)
        self.assertEqual(log.lines("crashed"), [])
        self.assertEqual(log.failures(), [])

    @staticmethod
    def _is_near(place: tuple[float, float, int], goal: tuple[float, float]) -> bool:
        x, y, height = place
        return abs(x - goal[0]) < 0.5 and abs(y - goal[1]) < 0.5 and height == 0

    def test_2_a_crash_is_an_event_and_part_of_state_and_diagnostics_and_ends_the_flights(
        self,
    ) -> None:
        log, mesh = self.log, self.mesh
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
    rostest.rosrun("drone_mesh", "dynamic_flight", DynamicFlightTest)
