#!/usr/bin/env python3
"""Drones that are cut off: one of a line flies after the one that died, jammed ones stay.

Before, the demonstration of a repair: at its end the fleet is as it was. Behind, what README shows.
"""

from __future__ import annotations

import math
import unittest

import rospy
import rostest
from rostest_support import LogWatch, MeshWatch, StateWatch, in_order
from std_msgs.msg import Bool
from test_documentation import DocumentationTest

from drone_mesh.console.controls import OrderRefused
from drone_mesh.console.demonstration import RepairDemonstration
from drone_mesh.msg import MeshState
from drone_mesh.ros.graph.conversions import mesh_status
from drone_mesh.ros.views.console_controls import RosControls
from drone_mesh.state.model import MeshStatus

AT_PLACE_M = 0.5
ROUTERS = range(1, 8)


class DemonstrationTest(unittest.TestCase):
    def test_when_it_says_that_all_is_put_back_all_is_as_before(self) -> None:
        log, states = LogWatch(), StateWatch()

        def next_state() -> MeshStatus:
            return mesh_status(states.next())

        MeshWatch(8).wait("all connected at the start", 30, lambda: all_connected(next_state()))
        before, controls, demonstration = next_state(), RosControls(), RepairDemonstration()
        mesh = before
        while not demonstration.is_over:
            try:
                for order in demonstration.advance(mesh):
                    order(controls)
            except OrderRefused as error:
                self.assertFalse(demonstration.is_leaving, error)
                demonstration.leave(str(error), mesh.stamp_s)
            mesh = next_state()
        told = [step.text for step in demonstration.story.steps]
        self.assertTrue(any("are connected again" in text for text in told), told)
        self.assertEqual(told[-1], "Everything is put back: power, places and speed", told)
        self.assertEqual(mesh.real_time_factor, before.real_time_factor)
        for was, now in zip(before.nodes, mesh.nodes):
            self.assertTrue(now.on and now.connected, now.id)
            self.assertLess(math.dist(now.position, was.position), AT_PLACE_M, now.id)
        self.assertEqual(log.failures(), [])


def all_connected(mesh: MeshStatus) -> bool:
    return all(node.connected for node in mesh.nodes)


class JammerTest(unittest.TestCase):
    def test_jammed_drones_stay_say_so_and_connect_again(self) -> None:
        log = LogWatch()
        mesh = MeshWatch(8)
        states: list[MeshState] = []
        rospy.Subscriber("/mesh/state", MeshState, states.append, queue_size=1)
        jammer = rospy.Publisher("/jammer", Bool, latch=True, queue_size=1)
        mesh.wait("all connected at the start", 30, mesh.connected)
        before = [mesh.place(node) for node in ROUTERS]
        jammer.publish(True)
        mesh.wait("all routers are cut off", 60, lambda: mesh.lost(*ROUTERS))

        def all_say_so() -> bool:
            routers = [node for node in states[-1].nodes if node.id != 0] if states else []
            words = [node.repair for node in routers]
            return len(words) == len(ROUTERS) and all("is jammed" in repair for repair in words)

        mesh.wait("all say that their channel is jammed", 90, all_say_so)
        self.assertTrue(all(node.jammed for node in states[-1].nodes if node.id != 0))
        mesh.pass_time(20.0)
        jammer.publish(False)
        mesh.wait("all connected again", 30, mesh.connected)
        self.assertEqual([mesh.place(node) for node in ROUTERS], before)
        self.assertEqual(log.failures(), [])


FLIGHT_S = 6.0 / 2.0  # from (-1, 16) to (-1, 10) at 2 m/s


CLEARANCE_M = 1.0  # by default: 2 may still be there, silent


def stands_beside(place: tuple[float, float, int], other: tuple[float, float]) -> bool:
    """On the ground, clear of the other place, and no farther from it than that needs."""
    x, y, height = place
    apart_m = math.dist((x, y), other)
    return height == 0 and CLEARANCE_M <= apart_m <= 1.25 * CLEARANCE_M


class RepairTest(unittest.TestCase):
    def test_the_last_of_a_line_flies_beside_the_place_of_the_one_that_died(self) -> None:
        log = LogWatch()
        mesh = MeshWatch(4)
        mesh.wait("all connected at the start", 30, mesh.connected)
        mesh.set_to_case(201)
        mesh.wait_at(3, -1, 16, within_s=30)
        mesh.wait(
            "3 knows its way, and the place it would fly to",
            60,
            lambda: mesh.hops() == {0: 0, 1: 1, 2: 2, 3: 3} and mesh.info(3).prefLoc == 2,
        )
        mesh.switch(2, False)
        mesh.wait("3 lost its gateway", 30, lambda: mesh.lost(3))
        # It may have its two hops while it is still descending.
        mesh.wait(
            "3 connected again, beside the place of 2",
            120 + FLIGHT_S,
            lambda: mesh.hops()[3] == 2 and stands_beside(mesh.place(3), (-1.0, 10.0)),
        )
        self.assertTrue(mesh.stands_at(1, -1, 4), "1 moved")
        self.assertEqual(log.failures(), [])


def suite() -> unittest.TestSuite:
    return in_order(DemonstrationTest, JammerTest, RepairTest, DocumentationTest)


if __name__ == "__main__":
    rospy.init_node("test_repair")
    rostest.rosrun("drone_mesh", "repair", "__main__.suite")
