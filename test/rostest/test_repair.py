#!/usr/bin/env python3
"""Layout 201, a line of three: the middle one falls silent, the last one flies beside it."""

from __future__ import annotations

import math
import unittest

import rospy
import rostest
from rostest_support import LogWatch, MeshWatch

FLIGHT_S = 6.0 / 2.0  # from (-1, 16) to (-1, 10) at 2 m/s


CLEARANCE_M = 1.0  # by default: 2 may still be there, silent


def stands_beside(place: tuple[float, float, int], other: tuple[float, float]) -> bool:
    """On the ground, clear of the other place, and no farther from it than that needs."""
    x, y, height = place
    apart_m = math.dist((x, y), other)
    return height == 0 and CLEARANCE_M <= apart_m <= 1.25 * CLEARANCE_M


class RepairTest(unittest.TestCase):
    def test_the_last_of_a_line_flies_beside_the_place_of_the_one_that_died(self) -> None:
        rospy.init_node("test_repair")
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


if __name__ == "__main__":
    rostest.rosrun("drone_mesh", "repair", RepairTest)
