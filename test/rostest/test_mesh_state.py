"""/mesh/state, /mesh/events and /diagnostics."""

from __future__ import annotations

import re
import unittest
from unittest.mock import patch

import rospy
from diagnostic_msgs.msg import DiagnosticArray
from rospy.impl.registration import RegManager
from rostest_support import WALL_LIMIT_S, LogWatch, call, wait_for
from std_msgs.msg import Float32

from drone_mesh.msg import MeshEvent, MeshState
from drone_mesh.srv import PowerSwitch, RequestDroneFlight, SetSpeed


class MeshStateTest(unittest.TestCase):
    def setUp(self) -> None:
        self.state: MeshState | None = None
        self.events: list[MeshEvent] = []
        self.diagnostics: DiagnosticArray | None = None
        self.log = LogWatch()
        rospy.Subscriber("/mesh/state", MeshState, self._on_state)
        events = rospy.Subscriber("/mesh/events", MeshEvent, self.events.append)
        rospy.Subscriber("/diagnostics", DiagnosticArray, self._on_diagnostics)
        wait_for("events can arrive", WALL_LIMIT_S, lambda: events.get_num_connections() > 0)

    def _on_state(self, message: MeshState) -> None:
        self.state = message

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        self.diagnostics = message

    def hops(self) -> list[int | None]:
        nodes = self.state.nodes if self.state else []
        return [node.hops if node.connected and node.on else None for node in nodes]

    def has_event(self, node: int, kind: str) -> bool:
        return any(event.node == node and event.kind == kind for event in list(self.events))

    def levels(self) -> dict[str, int]:
        return {s.name: s.level for s in self.diagnostics.status} if self.diagnostics else {}

    def test_0_the_master_watch_connects_a_subscription_whose_publisher_rospy_missed(self) -> None:
        with patch.object(RegManager, "publisher_update"):
            topic = rospy.Subscriber("/DroneFactory/real_time_factor", Float32)
        self.addCleanup(topic.unregister)
        wait_for("its publisher", WALL_LIMIT_S, lambda: topic.get_num_connections() > 0)

    def test_1_a_state_has_what_the_nodes_know_and_their_positions(self) -> None:
        wait_for("all connected", WALL_LIMIT_S, lambda: self.hops() == [0, 1, 1, 2])
        wait_for("routes and heartbeats", WALL_LIMIT_S, lambda: len(self.state.nodes[3].route) == 3)
        far = self.state.nodes[3]
        self.assertEqual(list(far.route), [3, 2, 0])
        self.assertEqual((far.gateway, far.next_hop, far.on, list(far.path)), (0, 2, True, []))
        self.assertEqual([round(metres, 3) for metres in far.position], [12.0, 0.0, 0.0])
        self.assertEqual(list(far.neighbours), [2])
        self.assertLess(far.report_age, 3.0)
        self.assertEqual(self.state.max_distance, 9.0)
        self.assertEqual(self.state.real_time_factor, 4.0)
        self.assertEqual(self.state.routing, "child_table_tree")
        self.assertEqual(self.state.repair_strategy, "thesis")
        self.assertEqual([node.repair for node in self.state.nodes], [""] * 4)
        wait_for("no trouble", WALL_LIMIT_S, lambda: self.levels() == {"drone_mesh: mesh": 0})

    def test_2_a_power_off_is_an_event_and_trouble(self) -> None:
        wait_for("all connected", WALL_LIMIT_S, lambda: self.hops() == [0, 1, 1, 2])
        call("/Nodes/2/powerSwitch", PowerSwitch, False)
        wait_for("2 is off", WALL_LIMIT_S, lambda: not self.state.nodes[2].on)
        wait_for("its event", WALL_LIMIT_S, lambda: self.has_event(2, "power off"))
        wait_for("3 is lost", WALL_LIMIT_S, lambda: self.hops() == [0, 1, None, None])
        # It waits for 30 s. At full speed it could take off before it is looked at.
        self.addCleanup(call, "/DroneFactory/setSpeed", SetSpeed, False, 4.0)
        self.assertTrue(call("/DroneFactory/setSpeed", SetSpeed, False, 0.5).success)
        wait_for("its event", WALL_LIMIT_S, lambda: self.has_event(3, "disconnected"))
        wait_for(
            "diagnostics",
            WALL_LIMIT_S,
            lambda: (
                self.levels().get("drone_mesh: node 2") == 1
                and self.levels().get("drone_mesh: node 3") == 2
            ),
        )
        wait_for(
            "3 waits for a gateway",
            WALL_LIMIT_S,
            lambda: re.fullmatch(r"waits \d+ s for a gateway", self.state.nodes[3].repair),
        )
        self.assertEqual(self.state.nodes[2].repair, "")
        self.assertTrue(call("/DroneFactory/setSpeed", SetSpeed, False, 4.0).success)
        call("/Nodes/2/powerSwitch", PowerSwitch, True)
        wait_for("all connected again", WALL_LIMIT_S, lambda: self.hops() == [0, 1, 1, 2])

    def test_3_a_flight_is_seen(self) -> None:
        wait_for("all connected", WALL_LIMIT_S, lambda: self.hops() == [0, 1, 1, 2])
        call("/DroneManager/requestDroneMovement", RequestDroneFlight, 3, 1.0, 12.0, 0)
        wait_for("3 arrived", WALL_LIMIT_S, lambda: self.has_event(0, "order arrived"))
        self.assertTrue(self.has_event(0, "order accepted"))
        arrived = next(event for event in list(self.events) if event.code == event.ORDER_ARRIVED)
        self.assertGreater(arrived.order, 0)
        self.assertEqual([(p.longitude, p.latitude) for p in arrived.place], [(12.0, 1.0)])
        self.assertEqual(arrived.detail, "")
        call("/DroneManager/requestDroneMovement", RequestDroneFlight, 3, 30.0, 12.0, 0)
        # Not any path: the state may still show the end of the first flight.
        goal = [12.0, 30.0, 0.0]
        wait_for("3 flies", WALL_LIMIT_S, lambda: list(self.state.nodes[3].path[-3:]) == goal)
        self.assertTrue(call("/DroneFactory/setSpeed", SetSpeed, False, 8.0).success)
        wait_for("3 landed", WALL_LIMIT_S, lambda: len(self.state.nodes[3].path) == 0)
        self.assertEqual(self.state.real_time_factor, 8.0)
        self.assertEqual(self.log.failures(), [])
