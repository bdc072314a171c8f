#!/usr/bin/env python3
"""The simulator and the manager are killed during a run, and restart knowing nothing."""

from __future__ import annotations

import unittest

import rospy
import rostest
from rostest_support import LogWatch, MeshWatch, call, kill_and_wait_for_respawn

from drone_mesh.srv import AreaScan, RequestDroneFlight


def near(node_id: int) -> list[int]:
    """The nodes that this one could send to."""
    return list(call("/SignalSimulator/othersinRange", AreaScan, node_id).near)


class RestartsTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls) -> None:
        rospy.init_node("test_restarts")
        cls.log = LogWatch()
        cls.mesh = MeshWatch(10)

    def test_the_mesh_is_connected_again_and_a_node_that_was_off_stays_off(self) -> None:
        log, mesh = self.log, self.mesh
        others = [node_id for node_id in range(10) if node_id != 9]
        mesh.wait("all connected", 30, mesh.connected)
        mesh.switch(9, False)
        mesh.wait("9 off in the simulator", 3, lambda: 9 not in near(5))
        near_before = near(5)
        kill_and_wait_for_respawn("/WirelessSignalSimulator")
        # Read only now, when the reports include all packets that the killed one carried.
        sent_before = {node_id: mesh.info(node_id).totalMessages for node_id in others}

        def all_sent() -> bool:
            return all(mesh.info(n).totalMessages > sent_before[n] for n in others)

        mesh.wait(
            "all but 9 connected, with packets that the new simulator carried",
            20,
            lambda: mesh.connected(others) and all_sent(),
        )
        self.assertEqual(near(5), near_before)
        self.assertNotIn(9, near(6))
        self.assertLessEqual(len(log.lines("lost the simulator")), 1)
        self.assertEqual(log.failures(), [])

    def test_an_order_to_the_manager_that_came_back_moves_a_drone(self) -> None:
        self.mesh.wait("all but 9 connected", 60, lambda: self.mesh.connected(range(9)))
        kill_and_wait_for_respawn("/DroneManager")

        def ordered() -> bool:
            try:
                answer = call(
                    "/DroneManager/requestDroneMovement", RequestDroneFlight, 2, 4.0, 3.0, 0
                )
            except rospy.ServiceException:
                return False  # the master may know the address of the dead one for a moment
            return bool(answer.status == 1)

        self.mesh.wait("the manager did not find the gateway", 40, ordered)
        self.mesh.wait_at(2, 3.0, 4.0, within_s=20)
        self.mesh.wait("0 and 1 connected", 2, lambda: self.mesh.connected([0, 1]))
        self.assertEqual(self.log.failures(), [])


if __name__ == "__main__":
    rostest.rosrun("drone_mesh", "restarts", RestartsTest)
