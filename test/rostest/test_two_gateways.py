#!/usr/bin/env python3
"""Two gateways side by side: routers stay with theirs, and move to the other when it dies."""

from __future__ import annotations

import unittest

import rospy
import rostest
from rostest_support import LogWatch, MeshWatch, call

from drone_mesh.srv import PowerSwitch

ROUTERS = range(2, 6)
FIRST_ROUND_S = 12.0  # one check period, and a little


class TwoGatewaysTest(unittest.TestCase):
    def test_routers_do_not_flap_and_survive_the_death_of_their_gateway(self) -> None:
        rospy.init_node("test_two_gateways")
        log = LogWatch()
        mesh = MeshWatch(6)
        mesh.wait("all connected", 30, mesh.connected)

        def preferred() -> dict[int, int]:
            return {router: mesh.info(router).prefferedGateWay for router in ROUTERS}

        mesh.pass_time(FIRST_ROUND_S)  # in which a shorter way may still be found
        before = preferred()
        sent = [mesh.info(gateway).totalMessages for gateway in (0, 1)]
        for _second in range(40):
            mesh.pass_time(1.0)
            self.assertEqual(preferred(), before)
        for gateway in (0, 1):  # at most 5 nodes, a few packets each in four check periods
            self.assertLess(mesh.info(gateway).totalMessages - sent[gateway], 200)

        offline = before[2]
        other = 1 - offline
        self.switch_internet(offline, False)
        mesh.wait(
            f"all routers at gateway {other}, gateway {offline} behind them",
            45,
            lambda: (
                mesh.connected(ROUTERS)
                and set(preferred().values()) == {other}
                and mesh.info(offline).prefferedGateWay == other
            ),
        )
        self.switch_internet(offline, True)
        mesh.wait(
            f"gateway {offline} back",
            45,
            lambda: mesh.connected() and mesh.info(offline).prefferedGateWay == offline,
        )

        dead = mesh.info(2).prefferedGateWay
        other = 1 - dead
        mesh.switch(dead, False)
        mesh.wait(
            f"all routers at gateway {other}",
            45,
            lambda: mesh.connected(ROUTERS) and set(preferred().values()) == {other},
        )
        self.assertEqual(log.failures(), [])

    def switch_internet(self, gateway: int, works: bool) -> None:
        call(f"/Nodes/{gateway}/internetSwitch", PowerSwitch, works)


if __name__ == "__main__":
    rostest.rosrun("drone_mesh", "two_gateways", TwoGatewaysTest)
