"""Drones are ordered through actions, added to a running simulation and removed from it."""

from __future__ import annotations

import subprocess
import sys
import unittest
from pathlib import Path

import actionlib
import rosgraph
import rospy
from actionlib_msgs.msg import GoalStatus
from rostest_support import WALL_LIMIT_S, LogWatch, MeshWatch, call, run_program, wait_for

from drone_mesh.msg import FlyAction, FlyFeedback, FlyGoal, FlyResult, MeshState, NodeState
from drone_mesh.srv import AddDrone, OrderFlight, RemoveDrone, RequestDroneFlight, SetSpeed

SLOW, FAST = 0.2, 4.0  # simulated seconds per wall second
EXAMPLE = Path(__file__).resolve().parents[2] / "examples" / "fly_by_action.py"


class FlyActionsTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls) -> None:
        cls.log = LogWatch()
        cls.mesh = MeshWatch(3)
        cls.mesh.wait("all connected", 60, cls.mesh.connected)

    def setUp(self) -> None:
        self.feedback: list[FlyFeedback] = []
        self.mesh.wait("all connected", 60, self.mesh.connected)

    def tearDown(self) -> None:
        self.assertEqual(self.log.failures(), [])

    def speed(self, factor: float) -> None:
        call("/DroneFactory/setSpeed", SetSpeed, False, factor)

    def client(self, drone: int) -> actionlib.SimpleActionClient:
        client = actionlib.SimpleActionClient(f"/Drones/{drone}/fly", FlyAction)
        within = rospy.Duration(4 * WALL_LIMIT_S)  # simulated
        self.assertTrue(client.wait_for_server(within), f"no action of drone {drone}")
        return client

    def fly(self, drone: int, latitude: float, longitude: float, height: int = 0):
        client = self.client(drone)
        goal = FlyGoal(latitude, longitude, height)
        client.send_goal(goal, feedback_cb=self.feedback.append)
        return client

    def result_of(self, client: actionlib.SimpleActionClient) -> tuple[int, FlyResult]:
        within = rospy.Duration(4 * WALL_LIMIT_S)
        self.assertTrue(client.wait_for_result(within), "no result")
        return client.get_state(), client.get_result()

    def example(self, *words: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [sys.executable, str(EXAMPLE), *words],
            stdout=subprocess.PIPE,
            timeout=2 * WALL_LIMIT_S,
            check=False,
            text=True,
        )

    def test_0_the_example_names_a_drone_that_is_not_there(self) -> None:
        example = self.example("42", "6", "4")
        self.assertEqual(example.returncode, 1, example.stdout)
        self.assertEqual(
            example.stdout,
            "there is no drone 42: `rosrun drone_mesh status` lists the drones\n",
        )

    def test_1_the_example_follows_a_flight_to_its_end(self) -> None:
        self.speed(1.0)  # the drone's answer comes long before its flight ends
        example = self.example("2", "6", "4")
        self.speed(FAST)
        self.assertEqual(example.returncode, 0, example.stdout)
        self.assertRegex(example.stdout, r"under way, \d+ m and \d+ s left: x ")
        self.assertEqual(example.stdout.splitlines()[-1], "arrived")
        self.assertTrue(self.mesh.stands_at(2, 6.0, 4.0))

    def test_2_a_flight_that_is_cancelled_ends_where_the_drone_is(self) -> None:
        self.speed(SLOW)
        client = self.fly(1, 0.0, 10.0)  # at a height of 5 m, always within reach of another node
        wait_for(
            "feedback on the way",
            WALL_LIMIT_S,
            lambda: (
                self.feedback
                and self.feedback[-1].state.startswith("under way")
                and self.feedback[-1].longitude > 1.0
            ),
        )
        client.cancel_goal()
        state, result = self.result_of(client)
        self.assertEqual((state, result.outcome), (GoalStatus.PREEMPTED, FlyResult.CANCELLED))
        self.assertRegex(result.message, "^ordered to stop at x .* z 5 m$")
        self.speed(FAST)

        def hovers() -> bool:
            before = self.mesh.place(1)
            self.mesh.pass_time(2.0)
            return self.mesh.place(1) == before

        wait_for("the drone to hover", WALL_LIMIT_S, hovers)
        x, _, height = self.mesh.place(1)
        self.assertLess(x, 9.0)
        self.assertEqual(height, 5)
        self.mesh.wait("1 connected again", 60, lambda: self.mesh.connected([1]))
        state, _ = self.result_of(self.fly(1, 0.0, 0.0))
        self.assertEqual(state, GoalStatus.SUCCEEDED)

    def test_3_what_is_no_order_is_rejected_with_the_reason(self) -> None:
        state, result = self.result_of(self.fly(1, 0.0, 0.0, height=501))
        self.assertEqual((state, result.outcome), (GoalStatus.REJECTED, FlyResult.REFUSED))
        self.assertIn("height 501 m is outside", result.message)

    def test_4_another_order_ends_a_flight(self) -> None:
        self.speed(SLOW)
        client = self.fly(2, -4.0, 6.0)
        wait_for(
            "the flight",
            WALL_LIMIT_S,
            lambda: self.feedback and self.feedback[-1].state.startswith("under way"),
        )
        self.speed(FAST)
        call("/DroneManager/requestDroneMovement", RequestDroneFlight, 2, 4.0, 6.0, 0)
        state, result = self.result_of(client)
        self.assertEqual((state, result.outcome), (GoalStatus.ABORTED, FlyResult.REPLACED))
        self.assertRegex(result.message, r"^replaced by order \d+$")
        self.mesh.wait_at(2, 6.0, 4.0, within_s=60)

    def test_5_actions_come_and_go_with_their_drones(self) -> None:
        added = call("/DroneFactory/addDrone", AddDrone, 7, False, 0.0, 3.0)
        self.assertTrue(added.success, added.message)
        newcomer = MeshWatch(8)
        newcomer.wait("7 connected", 60, lambda: newcomer.connected([7]))
        state, result = self.result_of(self.fly(7, 2.0, 3.0))
        self.assertEqual(state, GoalStatus.SUCCEEDED, result)
        call("/DroneFactory/removeDrone", RemoveDrone, 7)

        def offered() -> bool:
            return any(topic == "/Drones/7/fly/status" for topic, _ in rospy.get_published_topics())

        wait_for("the action withdrawn", WALL_LIMIT_S, lambda: not offered())

    def test_6_command_action_and_service_say_who_would_have_no_route(self) -> None:
        warning = "drone 2 would have no route there"
        self.speed(SLOW)
        command = run_program("fly", "2", "6", "-60")
        self.assertEqual(command.returncode, 2, command.stdout)
        why = f"not ordered: {warning}; --out-of-reach orders it all the same"
        self.assertIn(why, command.stderr)
        self.fly(2, -60.0, 6.0)
        wait_for(
            "the warning",
            WALL_LIMIT_S,
            lambda: self.feedback and self.feedback[-1].state.endswith(f" left; {warning}"),
        )
        far = call("/DroneManager/orderFlight", OrderFlight, 2, -61.0, 6.0, 0, False)
        self.assertEqual((far.success, far.message), (True, warning))
        near = call("/DroneManager/orderFlight", OrderFlight, 2, 4.0, 6.0, 0, False)
        self.assertEqual((near.success, near.message), (True, ""))
        line = f"drone 2 ordered to x 6.00 m, y -61.00 m, z 0 m: {warning}"
        wait_for("the line in the log", WALL_LIMIT_S, lambda: self.log.lines(line))
        self.speed(FAST)
        self.mesh.wait_at(2, 6.0, 4.0, within_s=60)


LOWEST_FREE = 255


class FleetChangesTest(unittest.TestCase):
    def setUp(self) -> None:
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
        self.assertEqual(self.order(2, 0.0, 6.0), 1)  # from where the actions have left it
        self.mesh.wait_at(2, 6.0, 0.0, within_s=60)
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
