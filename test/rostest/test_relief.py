#!/usr/bin/env python3
"""Two drones hover for longer than their batteries last, because two spares relieve them."""

from __future__ import annotations

import math
import unittest

import rospy
import rostest
from rostest_support import MeshWatch, call, wait_for

from drone_mesh.msg import Location, MeshState
from drone_mesh.srv import OrderFormation

POSTS = {3: (5.0, 4.0, 4), 4: (5.0, 8.0, 4)}  # x, y, z
POSTS_KEPT_S = 420.0  # simulated; a battery lasts for 180 s
HOLDS_M = 2.2  # of the place or the one beside it


class ReliefTest(unittest.TestCase):
    def test_two_posts_stay_held_by_drones_that_take_turns(self) -> None:
        mesh = MeshWatch(5)
        mesh.wait("all connected at the start", 60, mesh.connected)
        places = [Location(latitude=y, longitude=x, height=z) for x, y, z in POSTS.values()]
        call(
            "/DroneManager/orderFormation", OrderFormation, "posts", list(POSTS), places, False, []
        )
        held: list[set[int]] = [set(), set()]
        since_s = math.inf
        gaps, apart_m, charges = 0, math.inf, []

        def look(state: MeshState) -> None:
            nonlocal since_s, gaps, apart_m
            now_s = state.header.stamp.to_sec()
            near = [
                {
                    n.id
                    for n in state.nodes
                    if n.connected and math.dist(n.position, place) < HOLDS_M
                }
                for place in POSTS.values()
            ]
            if all(near):
                since_s = min(since_s, now_s)
            if since_s < math.inf:
                gaps += not all(near)
                for drones, new in zip(held, near):
                    drones |= new
                in_air = [n for n in state.nodes if n.position[2] > 1.0]
                charges.extend(n.battery for n in in_air)
                for one in in_air:
                    for other in state.nodes:
                        if other.id != one.id:
                            apart_m = min(apart_m, math.dist(one.position, other.position))

        rospy.Subscriber("/mesh/state", MeshState, look)
        wait_for(
            "the posts were held for longer than two batteries",
            300,
            lambda: rospy.get_time() - since_s > POSTS_KEPT_S,
        )
        self.assertEqual(set.union(*held), {1, 2, 3, 4})  # both spares took their turns
        self.assertGreater(min(map(len, held)), 1)
        self.assertEqual(gaps, 0)
        self.assertGreater(min(charges), 19.0)
        self.assertGreater(apart_m, 0.9)


if __name__ == "__main__":
    rospy.init_node("test_relief")
    rostest.rosrun("drone_mesh", "relief", ReliefTest)
