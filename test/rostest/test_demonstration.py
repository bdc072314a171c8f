#!/usr/bin/env python3
"""The demonstration of a repair over ROS: at its end the fleet is as it was."""

from __future__ import annotations

import math
import unittest

import rospy
import rostest
from rostest_support import LogWatch, MeshWatch, StateWatch

from drone_mesh.console.controls import OrderRefused
from drone_mesh.console.demonstration import RepairDemonstration
from drone_mesh.ros.graph.conversions import mesh_status
from drone_mesh.ros.views.console_controls import RosControls
from drone_mesh.state.model import MeshStatus

AT_PLACE_M = 0.5


class DemonstrationTest(unittest.TestCase):
    def test_when_it_says_that_all_is_put_back_all_is_as_before(self) -> None:
        rospy.init_node("test_demonstration")
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


if __name__ == "__main__":
    rostest.rosrun("drone_mesh", "demonstration", DemonstrationTest)
