#!/usr/bin/env python3
"""Layouts are standing orders: kept until each drone is at its place, replaced, or withdrawn."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import tempfile
import unittest
from pathlib import Path
from typing import Any, Sequence

import actionlib
import rospy
import rostest
from actionlib_msgs.msg import GoalStatus
from rostest_support import (
    LogWatch,
    MeshWatch,
    call,
    pid_of,
    preload,
    program,
    run_program,
    wait_for,
)

from drone_mesh.formations.layouts import Layouts
from drone_mesh.msg import (
    LayoutAction,
    LayoutFeedback,
    LayoutGoal,
    LayoutProgress,
    Location,
    MeshState,
)
from drone_mesh.srv import OrderFormation, OrderLayout, SetSpeed, WithdrawLayout

DRAWN = (
    ("drone 1", [5.1213562, 52.0907270]),  # x -3, y 3
    ("the old oak", [5.1213708, 52.0907270]),  # x -2, y 3
)
FLIGHTS_S = 120  # wall; the longest takes less than 15 simulated seconds
CASES = Layouts.load(Path(__file__).with_name("standing_layouts.yaml"))


def waits_for_5(progress: LayoutProgress) -> bool:
    return bytes(progress.waiting) == bytes([5])


class StandingLayoutsTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls) -> None:
        cls.log = LogWatch()
        cls.mesh = MeshWatch(6)
        cls.progress: dict[int, LayoutProgress] = {}
        rospy.Subscriber("/DroneManager/layouts", LayoutProgress, cls.heard)
        cls.mesh.wait("all connected at the start", 60, cls.mesh.connected)

    @classmethod
    def heard(cls, progress: LayoutProgress) -> None:
        cls.progress[progress.id] = progress

    def order(self, case: int) -> int:
        return int(call("/DroneManager/orderLayout", OrderLayout, case, False).id)

    def wait_until_over(self, number: int) -> LayoutProgress:
        what = f"standing order {number} is over"
        wait_for(what, FLIGHTS_S, lambda: number in self.progress and self.progress[number].over)
        return self.progress[number]

    def test_1_a_second_layout_reaches_the_drones_that_were_in_flight_when_it_came(self) -> None:
        first = self.order(0)
        self.mesh.pass_time(3.0)
        second = self.order(202)
        done = self.wait_until_over(second)
        drones = sorted(dict(CASES.orders(202)))
        self.assertEqual(sorted(done.arrived), drones)
        self.assertEqual(sorted(self.wait_until_over(first).replaced), drones)
        states: list[MeshState] = []
        rospy.Subscriber("/mesh/state", MeshState, states.append)
        wait_for("the state says so", 20, lambda: states and states[-1].layouts)
        self.assertRegex(states[-1].layouts[-1], r"^layout (0|202): \d+ of \d+ at their places")

    def test_2_an_action_reports_progress_and_success(self) -> None:
        client = actionlib.SimpleActionClient("/DroneManager/layout", LayoutAction)
        self.assertTrue(client.wait_for_server(rospy.Duration(60)), "no action server")
        heard: list[LayoutFeedback] = []
        client.send_goal(LayoutGoal(0, False), feedback_cb=heard.append)
        self.assertTrue(client.wait_for_result(rospy.Duration(600)), "the layout did not end")
        self.assertEqual(client.get_state(), GoalStatus.SUCCEEDED, client.get_goal_status_text())
        self.assertEqual(client.get_result().message, "5 of 5 at their places")
        self.assertTrue(any(feedback.flying for feedback in heard))

    def test_3_a_subscriber_that_comes_late_still_gets_the_goal(self) -> None:
        """The engine's connection may take a second more than the order."""
        goal = rospy.wait_for_message("/Drones/5/goal", Location, FLIGHTS_S)
        self.assertEqual((goal.longitude, goal.latitude, goal.height), (-4.0, 6.0, 0))
        self.mesh.wait_at(5, -4.0, 6.0, within_s=5.0)

    def test_3_a_drone_is_not_replaced_by_its_own_order_whatever_its_decimals(self) -> None:
        """Whose third decimal is 5: as float32, in an order, it rounds to other hundredths."""
        places = [Location(-2.205, -3.145, 0), Location(3.315, 6.135, 0)]
        formation = ("a", [1, 2], places, False, [])
        number = call("/DroneManager/orderFormation", OrderFormation, *formation).id
        done = self.wait_until_over(number)
        self.assertEqual(bytes(done.arrived), bytes([1, 2]), done.message)

    def test_4_a_restarted_manager_goes_on_and_a_withdrawn_layout_ends(self) -> None:
        self.mesh.switch(5, False)
        number = self.order(100)
        wait_for("it waits for 5", FLIGHTS_S, lambda: bytes([5]) == self.waiting(number))
        self.assertEqual(self.stored(number), ["5"])
        before = pid_of("/DroneManager")
        os.kill(before, signal.SIGKILL)
        wait_for("another manager", 60, lambda: pid_of("/DroneManager") not in (None, before))
        self.mesh.switch(5, True)
        self.assertEqual(self.wait_until_over(number).arrived, bytes([5]))
        self.mesh.switch(5, False)
        number = self.order(0)
        wait_for("it waits for 5", FLIGHTS_S, lambda: bytes([5]) == self.waiting(number))
        self.assertTrue(call("/DroneManager/withdrawLayout", WithdrawLayout, number).success)
        self.assertEqual(bytes(self.wait_until_over(number).waiting), bytes([5]))
        self.assertFalse(call("/DroneManager/withdrawLayout", WithdrawLayout, number).success)

    def test_5_the_commands_show_progress_and_withdraw_on_ctrl_c(self) -> None:
        self.mesh.wait("1 and 2 connected", 60, lambda: self.mesh.connected((1, 2)))
        self.assertTrue(call("/DroneFactory/setSpeed", SetSpeed, False, 1.0).success)
        flight = run_program("fly", "1", "-1.5", "2", "0")  # it shows some of the states that come
        self.assertTrue(call("/DroneFactory/setSpeed", SetSpeed, False, 5.0).success)
        self.assertEqual(flight.returncode, 0, flight.stdout + flight.stderr)
        self.assertRegex(flight.stdout, r"under way, \d+ m and \d+ s left\n(.*\n)*arrived\n")
        done = run_program("layout", "1")
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
        self.assertIn("1 of 1 at their place", done.stdout)
        drawn = run_program("layout", "--file", self.drawing())
        self.assertEqual(drawn.returncode, 0, drawn.stdout + drawn.stderr)
        self.assertIn("2 of 2 at their places", drawn.stdout)
        self.mesh.wait_at(4, -2.0, 3.0, within_s=5.0)
        self.assertIn("drone 1 to x -3, y 3, z 0 m\ndrone 4 to x -2, y 3, z 0 m\n", drawn.stdout)
        self.missions_and_gateways_stay()
        layout = subprocess.Popen(  # 5 is off and elsewhere, since the test before
            program("layout", "--at-once", "5"), stdout=subprocess.PIPE, text=True
        )
        self.assertIn("ordered", layout.stdout.readline())
        wait_for("it waits for 5", FLIGHTS_S, lambda: any(map(waits_for_5, self.open())))
        (number,) = (progress.id for progress in self.open())
        (kept,) = self.stored_orders()
        self.assertTrue(kept["at_once"])
        os.kill(layout.pid, signal.SIGINT)
        self.assertEqual(layout.wait(60), 130)
        self.assertTrue(self.wait_until_over(number).over)
        for wrong in (["fly", "254", "0", "0"], ["fly", "1", "nan", "0"], ["layout", "0x1"]):
            refused = run_program(*wrong)
            self.assertEqual(refused.returncode, 2)
            self.assertIn("invalid value", refused.stderr)

    def missions_and_gateways_stay(self) -> None:
        """Points "0 " and "1 " of a ground station's mission are no drones, and move nobody."""
        line = {"type": "LineString", "coordinates": [at for _name, at in DRAWN]}
        mission = self.drawing([("0 ", DRAWN[0][1]), ("1 ", DRAWN[1][1])], line)
        refused = run_program("layout", "--file", mission)
        self.assertEqual(refused.returncode, 2, refused.stdout)
        self.assertIn("a mission of one drone, as a line goes through its 2", refused.stderr)
        gateway = self.drawing([("gateway 0", [5.1213562, 52.0907])])  # x -3, y 0
        refused = run_program("layout", "--file", gateway)
        self.assertEqual(refused.returncode, 2, refused.stdout)
        self.assertRegex(refused.stderr, r"would move gateway 0: .*--gateway")
        moved = run_program("layout", "--file", gateway, "--gateway", "0")
        self.assertIn("drone 0 to x -3", moved.stdout, moved.stderr)
        self.assertNotEqual(moved.returncode, 2)

    def drawing(self, points: Sequence[tuple[str, object]] = DRAWN, *geometries: object) -> str:
        """A file of another program: a place for drone 1, and one for the nearest, which is 4."""
        drawn = [(name, {"type": "Point", "coordinates": place}) for name, place in points]
        features = [
            {"type": "Feature", "properties": {"name": name}, "geometry": geometry}
            for name, geometry in [*drawn, *(("", geometry) for geometry in geometries)]
        ]
        path = Path(tempfile.mkdtemp()) / "field.geojson"
        path.write_text(json.dumps({"type": "FeatureCollection", "features": features}))
        self.addCleanup(shutil.rmtree, path.parent)
        return str(path)

    def open(self) -> list[LayoutProgress]:
        return [progress for progress in self.progress.values() if not progress.over]

    def stored(self, number: int) -> list[str]:
        """The drones that a manager which starts now would order."""
        orders = self.stored_orders()
        return [drone for order in orders if order["number"] == number for drone in order["goals"]]

    def stored_orders(self) -> list[dict[str, Any]]:
        stored = json.loads(rospy.get_param("/drone_mesh/standing"))
        orders: list[dict[str, Any]] = stored["orders"]["orders"]
        return orders

    def waiting(self, number: int) -> bytes | None:
        """Its drones without a route, once no other drone is to fly any more."""
        progress = self.progress.get(number)
        moves = progress is None or progress.flying or progress.later
        return None if moves else bytes(progress.waiting)


if __name__ == "__main__":
    preload("drone_mesh.ros.views.order_commands")
    rospy.init_node("test_standing_layouts")
    rostest.rosrun("drone_mesh", "standing_layouts", StandingLayoutsTest)
