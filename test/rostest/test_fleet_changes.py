#!/usr/bin/env python3
"""Drones are added to a running simulation and removed from it."""

from __future__ import annotations

import unittest

import rosgraph
import rospy
import rostest
from rostest_support import WALL_LIMIT_S, LogWatch, MeshWatch, call, wait_for

from drone_mesh.msg import MeshState, NodeState
from drone_mesh.srv import AddDrone, RemoveDrone, RequestDroneFlight

LOWEST_FREE = 255


class FleetChangesTest(unittest.TestCase):
    def setUp(self) -> None:
        rospy.init_node("test_fleet_changes")
        self.nodes: dict[int, NodeState] = {}
        rospy.Subscriber("/mesh/state", MeshState, self.take)
        self.log = LogWatch()
        self.mesh = MeshWatch(5)

    def take(self, state: MeshState) -> None:
        self.nodes = {node.id: node for node in state.nodes}

    def names_of(self, node_id: int) -> list[str]:
        """The topics and services of one drone that another ROS node offers or subscribes to.

        Not its packets: the simulator keeps that topic open for a drone that comes back.
        """
        published, subscribed, services = rosgraph.Master(rospy.get_name()).getSystemState()
        ours = rospy.get_name()
        return [
            name
            for name, users in [*published, *subscribed, *services]
            if name.startswith((f"/Drones/{node_id}/", f"/Nodes/{node_id}/")) and users != [ours]
        ]

    def add(self, node_id: int, latitude: float, longitude: float, gateway: bool = False) -> None:
        place = (latitude, longitude)
        answer = call("/DroneFactory/addDrone", AddDrone, node_id, gateway, *place)
        self.assertTrue(answer.success, answer.message)
        self.assertIn("/DroneFactory runs its node", answer.message)

    def refusal_of(self, service: str, service_class: type, *arguments: object) -> str:
        answer = call(service, service_class, *arguments)
        self.assertFalse(answer.success, answer.message)
        return answer.message

    def order(self, node_id: int, latitude: float, longitude: float) -> int:
        place = (latitude, longitude, 0)
        service = "/DroneManager/requestDroneMovement"
        return call(service, RequestDroneFlight, node_id, *place).status

    def route_of(self, node_id: int) -> list[int]:
        return list(self.nodes[node_id].route) if node_id in self.nodes else []

    def has_neighbour(self, node_id: int, other: int) -> bool:
        return node_id in self.nodes and other in self.nodes[node_id].neighbours

    def test_a_drone_joins_flies_leaves_and_joins_again(self) -> None:
        self.mesh.wait("all connected", 60, lambda: self.mesh.connected(range(3)))
        self.refusals()

        self.add(LOWEST_FREE, 0.0, 14.0)  # 8 m from router 2, out of reach of all others
        self.mesh.wait("3 connected", 60, lambda: self.mesh.connected([3]))
        self.mesh.wait("through 2", 60, lambda: self.route_of(3) == [3, 2, 0])
        self.assertEqual(self.order(3, 3.0, 12.0), 1)
        self.mesh.wait_at(3, 12.0, 3.0, within_s=60)
        self.mesh.wait("3 connected again", 60, lambda: self.mesh.connected([3]))
        self.mesh.wait("2 knows 3", 60, lambda: self.has_neighbour(2, 3))

        answer = call("/DroneFactory/removeDrone", RemoveDrone, 3)
        self.assertTrue(answer.success, answer.message)
        wait_for("3 out of the state", WALL_LIMIT_S, lambda: set(self.nodes) == {0, 1, 2})
        wait_for("its names withdrawn", WALL_LIMIT_S, lambda: self.names_of(3) == [])
        self.mesh.wait("2 notices", 60, lambda: not self.has_neighbour(2, 3))
        with self.assertRaisesRegex(rospy.ServiceException, "drone 3 is not in this fleet: .*0..2"):
            self.order(3, 1.0, 1.0)

        self.add(3, 7.0, 6.0)  # it stays there: the order of the first drone 3 is forgotten
        # Not from its debug topic: the last message there is from the first drone 3.
        self.mesh.wait("3 connected once more", 60, lambda: self.route_of(3)[-1:] == [0])
        self.mesh.wait("2 knows it again", 60, lambda: self.has_neighbour(2, 3))
        self.assertEqual(self.mesh.place(3), (6.0, 7.0, 0))

        self.add(4, 0.0, -3.0, gateway=True)
        self.mesh.wait("a second gateway", 60, lambda: self.mesh.connected([4]))
        answer = call("/DroneFactory/removeDrone", RemoveDrone, 0)
        self.assertTrue(answer.success, answer.message)
        self.mesh.wait(
            "the others use gateway 4",
            120,
            lambda: (
                [self.nodes[n].gateway for n in (1, 2, 3) if self.nodes[n].connected] == [4] * 3
            ),
        )
        self.assertEqual(self.order(1, 1.0, 1.0), 1)
        self.mesh.wait_at(1, 1.0, 1.0, within_s=60)
        self.assertEqual(self.log.failures(), [])

    def refusals(self) -> None:
        add, remove = "/DroneFactory/addDrone", "/DroneFactory/removeDrone"
        for arguments, why in (
            ((2, False, 0.0, 14.0), "drone 2 exists already"),
            ((254, False, 0.0, 14.0), "invalid drone id 254: must be 0..253"),
            ((9, False, 0.0, float("nan")), "invalid place: longitude nan is not a finite"),
            ((9, False, 5001.0, 0.0), "invalid place: latitude 5001 m is outside"),
            ((9, False, 0.1, 6.1), "invalid place: drone 2 is there"),
        ):
            self.assertIn(why, self.refusal_of(add, AddDrone, *arguments))
        self.assertIn("drone 9 does not exist", self.refusal_of(remove, RemoveDrone, 9))
        self.assertIn("the last gateway", self.refusal_of(remove, RemoveDrone, 0))
        self.assertEqual(set(rospy.get_param("/drone_mesh/drones")["routers"]), {1, 2})


if __name__ == "__main__":
    rostest.rosrun("drone_mesh", "fleet_changes", FleetChangesTest)
