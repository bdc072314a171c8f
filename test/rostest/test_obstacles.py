#!/usr/bin/env python3
"""obstacles:=FILE: a wall hides a node from the mesh, and its drone flies over the wall."""

from __future__ import annotations

import unittest

import rospy
import rostest
from rostest_support import WALL_LIMIT_S, LogWatch, MeshWatch, call, wait_for

from drone_mesh.msg import DroneInfo, Location, MeshEvent, MeshState
from drone_mesh.srv import AreaScan, RequestDroneFlight

WALL_TOP_M = 5.0


class ObstaclesTest(unittest.TestCase):
    def test_a_wall_hides_a_node_until_its_drone_has_flown_over_it(self) -> None:
        rospy.init_node("test_obstacles")
        log, mesh = LogWatch(), MeshWatch(3)
        mesh.wait("router 1 connected", 60, lambda: mesh.connected([1]))
        mesh.wait("a report of router 2", 60, lambda: 2 in mesh.hops())
        mesh.pass_time(25.0)  # two checks of each node
        self.assertIsNone(mesh.hops()[2], "the wall does not stop the radio")
        self.assertEqual(bytes(call("/SignalSimulator/othersinRange", AreaScan, 1).near), b"\0")
        state = rospy.wait_for_message("/mesh/state", MeshState, timeout=20)
        (box,) = state.obstacles
        self.assertEqual((box.center[:2], box.size[2]), ((3.0, 0.0), WALL_TOP_M))

        heights_m: list[float] = []  # of drone 2; calls of its gps service could miss the highest

        def note_height(info: DroneInfo) -> None:
            if info.nodeID == 2 and not info.sub:
                heights_m.append(info.position[2])

        positions = rospy.Subscriber("/WirelessSignalSimulator", DroneInfo, note_height)
        wait_for("positions", WALL_LIMIT_S, lambda: positions.get_num_connections() and heights_m)
        goal = rospy.Publisher("/Drones/2/goal", Location, queue_size=1, latch=True)
        goal.publish(Location(latitude=2.0, longitude=1.0, height=0))
        mesh.wait("drone 2 on this side of the wall", 60, lambda: mesh.place(2) == (1.0, 2.0, 0))
        wait_for("its way over the wall", WALL_LIMIT_S, lambda: max(heights_m) >= WALL_TOP_M)
        mesh.wait("all connected", 60, mesh.connected)

        events: list[tuple[int, str, str]] = []
        happened = rospy.Subscriber(
            "/mesh/events", MeshEvent, lambda e: events.append((e.node, e.kind, e.detail))
        )
        wait_for("events can arrive", WALL_LIMIT_S, lambda: happened.get_num_connections() > 0)
        call("/DroneManager/requestDroneMovement", RequestDroneFlight, 2, 0.0, 3.0, 0)
        mesh.wait("the refusal of a goal inside the wall", 60, lambda: self._is_refused(events))
        self.assertEqual(log.failures(), [])

    @staticmethod
    def _is_refused(events: list[tuple[int, str, str]]) -> bool:
        return any(
            (node, kind) == (0, "order refused") and "no path past the obstacles" in detail
            for node, kind, detail in events
        )


if __name__ == "__main__":
    rostest.rosrun("drone_mesh", "obstacles", ObstaclesTest)
