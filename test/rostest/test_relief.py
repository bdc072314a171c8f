#!/usr/bin/env python3
"""Two drones hover for longer than their batteries last, because two spares relieve them.

The manager is killed amid a relief. Before, the demonstration explains one relief.
"""

from __future__ import annotations

import math
import os
import signal
import unittest

import rospy
import rostest
from rostest_support import WALL_LIMIT_S, MeshWatch, StateWatch, call, pid_of, wait_for

from drone_mesh.communication.interfaces import NO_ROUTE
from drone_mesh.console.relief_demonstration import ReliefDemonstration
from drone_mesh.msg import Location, MeshState
from drone_mesh.ros.graph.conversions import mesh_status
from drone_mesh.ros.views.console_controls import RosControls
from drone_mesh.srv import OrderFormation, SetSpeed

POSTS = {3: (3.0, 3.0, 3), 4: (3.0, 7.0, 3)}  # x, y, z
POSTS_KEPT_S = 180.0  # simulated; a battery lasts for 120 s, and for 94 s until a relief is due
FACTOR = 4.0  # of the launch file
HOLDS_M = 2.2  # of the place or the one beside it


class ReliefTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls) -> None:
        cls.states = StateWatch()

    def test_1_the_demonstration_explains_a_relief_and_puts_everything_back(self) -> None:
        MeshWatch(5).wait(
            "all connected", 60, lambda: all(n.connected for n in self.states.next().nodes)
        )
        controls, demonstration = RosControls(), ReliefDemonstration()
        mesh = mesh_status(self.states.next())
        while not demonstration.is_over:
            for order in demonstration.advance(mesh):
                order(controls)
            mesh = mesh_status(self.states.next())
        told = [step.text for step in demonstration.story.steps]
        parts = ("[12] relieves [34]", "hovers beside", "flies home", "swaps its battery", "spare")
        self.assertRegex("; ".join(told), ".*".join(parts))
        self.assertEqual(told[-1], "Everything is put back: power, places and speed", told)

    def test_2_two_posts_stay_held_by_drones_that_take_turns(self) -> None:
        mesh = MeshWatch(5)
        mesh.wait("all connected at the start", 60, mesh.connected)
        routers = (
            "all have full batteries",
            60,
            lambda: min(n.battery for n in self.states.next().nodes[1:]) > 95,
        )
        wait_for(*routers)
        places = [Location(latitude=y, longitude=x, height=z) for x, y, z in POSTS.values()]
        call(
            "/DroneManager/orderFormation", OrderFormation, "posts", list(POSTS), places, False, []
        )
        held: list[set[int]] = [set(), set()]
        since_s = math.inf
        gaps, apart_m, charges = 0, math.inf, []
        killed: list[int] = []
        hover = 0

        def look(state: MeshState) -> None:
            nonlocal since_s, gaps, apart_m, hover
            now_s = state.header.stamp.to_sec()
            near = [
                {
                    n.id
                    for n in state.nodes
                    if n.connected and math.dist(n.position, place) < HOLDS_M
                }
                for place in POSTS.values()
            ]
            hover = sum(n.position[2] > 1.0 for n in state.nodes)
            comes = any(n.relieves != NO_ROUTE and len(n.path) for n in state.nodes)
            if comes and since_s < math.inf and not killed:
                killed.append(pid_of("/DroneManager") or 0)
                os.kill(killed[0], signal.SIGKILL)
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
        wait_for("a relief", 2 * WALL_LIMIT_S, lambda: killed)
        # A busy machine takes seconds to start a manager, of which the batteries know nothing.
        call("/DroneFactory/setSpeed", SetSpeed, False, 1.0)
        wait_for("a new one", WALL_LIMIT_S, lambda: pid_of("/DroneManager") not in (*killed, None))
        call("/DroneFactory/setSpeed", SetSpeed, False, FACTOR)
        wait_for(
            "the posts were held by drones with new batteries, too",
            300,
            lambda: rospy.get_time() - since_s > POSTS_KEPT_S,
        )
        self.assertNotIn(pid_of("/DroneManager"), [*killed, None])
        wait_for("only two hover: nobody holds a third post", WALL_LIMIT_S, lambda: hover == 2)
        self.assertEqual(set.union(*held), {1, 2, 3, 4})  # both spares took their turns
        self.assertGreater(min(map(len, held)), 1)
        self.assertEqual(gaps, 0)
        self.assertGreater(min(charges), 19.0)
        self.assertGreater(apart_m, 0.9)


if __name__ == "__main__":
    rospy.init_node("test_relief")
    rostest.rosrun("drone_mesh", "relief", ReliefTest)
