#!/usr/bin/env python3
"""Missions: a pilot flies a drone, the mesh follows, and an order pauses the mission; files."""

from __future__ import annotations

import math
import unittest
from pathlib import Path

import rospy
import rostest
from rostest_support import (
    WALL_LIMIT_S,
    LogWatch,
    call,
    preload,
    rest_between_ticks,
    run_program,
    wait_for,
)

from drone_mesh.msg import Location, MeshEvent, MeshState
from drone_mesh.srv import FlyMission, FlyMissionRequest, RequestDroneFlight

SQUARE = [(2.0, 2.0, 2.0), (2.0, -2.0, 2.0), (-2.0, -2.0, 2.0), (-2.0, 2.0, 2.0)]


def order(drone: int, **fields: object) -> object:
    """The answer of a drone's pilot."""
    return call(f"/Drones/{drone}/mission", FlyMission, FlyMissionRequest(**fields))


class MissionsTest(unittest.TestCase):
    def setUp(self) -> None:
        self.states: list[MeshState] = []
        self.events: list[MeshEvent] = []
        rospy.Subscriber("/mesh/state", MeshState, self.states.append)
        rospy.Subscriber("/mesh/events", MeshEvent, self.events.append)

    def node(self, node_id: int) -> object:
        wait_for("a state of the mesh", WALL_LIMIT_S, lambda: self.states)
        return next(node for node in self.states[-1].nodes if node.id == node_id)

    def place(self, node_id: int) -> tuple:
        return tuple(self.node(node_id).position)

    def passes(self, node_id: int, waypoint: tuple) -> None:
        wait_for(
            f"drone {node_id} near {waypoint}",
            WALL_LIMIT_S,
            lambda: math.dist(self.place(node_id), waypoint) < 1.2,
        )

    def test_a_mission_of_a_ground_station_is_flown_and_seen(self) -> None:
        """(5, 5, 4), then (0, 5, 4), at 2 m/s; drone 4 began it with the simulation."""
        file = Path(__file__).with_name("missions.waypoints")
        self.passes(4, (0.0, 5.0, 4.0))
        command = run_program("mission", "3", str(file), "--height", "6")
        self.assertEqual((command.returncode, command.stderr), (0, ""))
        begun, *shown, end = command.stdout.splitlines()
        self.assertIn("missions.waypoints: 2 waypoints; heights above home are", begun)
        self.assertIn("drone 3 flies it at 2 m/s", shown)
        self.assertTrue(any("waypoint 1 of 2" in line for line in shown), shown)
        self.assertEqual(end, "the mission is flown")
        self.assertLess(math.dist(self.place(3), (0.0, 5.0, 6.0)), 0.5)
        seen = {node.mission for mesh in self.states for node in mesh.nodes if node.id == 3}
        self.assertTrue(any(words.startswith("mission, waypoint 2 of 2") for words in seen), seen)
        wait_for("the end in the state", WALL_LIMIT_S, lambda: self.node(3).mission == "")

        run_program("mission", "1", "--pause")
        wait_for("a pause", WALL_LIMIT_S, lambda: self.node(1).mission.endswith("loop; paused"))
        self.assertEqual(run_program("mission", "1", "--resume").returncode, 0)
        gone = run_program("mission", "3", "--stop")
        self.assertEqual(gone.returncode, 2)
        self.assertIn("drone 3 has no mission", gone.stderr)
        nobody = run_program("mission", "77", str(file), "--loop", "--speed", "1")
        self.assertEqual(nobody.returncode, 2)
        self.assertIn("is there a drone 77 in a running simulation?", nobody.stderr)

    def test_the_mesh_follows_a_mission_and_an_order_pauses_it(self) -> None:
        log = LogWatch()
        for waypoint in SQUARE:
            self.passes(1, waypoint)
        node = self.node(1)
        self.assertEqual(list(node.path), [])  # no ordered flight
        self.assertEqual(len(node.heading), 3)
        wait_for("drone 1 connected in flight", WALL_LIMIT_S, lambda: self.node(1).connected)
        told = {e.kind for e in self.events if e.node == 1} & {"flight ordered", "landed"}
        self.assertEqual(told, set())

        call("/DroneManager/requestDroneMovement", RequestDroneFlight, 1, 3.0, 8.0, 0)
        heights = []

        def has_landed() -> bool:
            heights.append(self.place(1)[2])
            return math.dist(self.place(1), (8.0, 3.0, 0.0)) < 0.2

        wait_for("drone 1 at the place of its order", WALL_LIMIT_S, has_landed)
        self.assertLessEqual(max(heights), 2.1)  # cruise_height
        self.assertEqual(list(self.node(1).heading), [])
        self.assertTrue(order(1, action=FlyMissionRequest.RESUME).success)
        for waypoint in SQUARE:
            self.passes(1, waypoint)

        self.assertTrue(order(1, action=FlyMissionRequest.PAUSE).success)
        wait_for("a pause", WALL_LIMIT_S, lambda: not len(self.node(1).heading))
        self.assertTrue(order(1, action=FlyMissionRequest.STOP).success)
        answer = order(1, action=FlyMissionRequest.RESUME)
        self.assertEqual((answer.success, answer.message), (False, "drone 1 has no mission"))

        bad = order(2, speed=1.0)
        self.assertFalse(bad.success)
        self.assertIn("waypoints", bad.message)
        there = [Location(latitude=6.0, longitude=6.0, height=1)]
        good = order(2, waypoints=there, speed=2.0)
        self.assertTrue(good.success)
        self.passes(2, (6.0, 6.0, 1.0))
        wait_for("the end of a mission", WALL_LIMIT_S, lambda: self.node(2).mission == "")
        answer = order(2, action=FlyMissionRequest.RESUME)
        self.assertEqual((answer.success, answer.message), (False, "drone 2 has no mission"))
        answer = order(1, action=9)
        self.assertEqual(
            (answer.success, answer.message), (False, "drone 1: unknown action 9: use 0 to 3")
        )
        self.assertEqual(log.failures(), [])


if __name__ == "__main__":
    preload("drone_mesh.ros.views.mission_command")
    rospy.init_node("test_missions")
    rest_between_ticks()
    rostest.rosrun("drone_mesh", "missions", MissionsTest)
