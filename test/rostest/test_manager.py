#!/usr/bin/env python3
"""The DroneManager alone, with a gateway that only listens, or none."""

from __future__ import annotations

import math
import time
import unittest
from types import MappingProxyType
from typing import Container, Mapping

import rospy
import rostest
from rostest_support import LogWatch, call, wait_for

from drone_mesh.msg import FlightOrderAnswer, Location, RequestGatewayDroneFlight
from drone_mesh.srv import Casus, OrderFlight, OrderFormation, OrderLayout, RequestDroneFlight


def request(node_id: int, latitude: float, longitude: float, height: int) -> int:
    place = (latitude, longitude, height)
    return call("/DroneManager/requestDroneMovement", RequestDroneFlight, node_id, *place).status


class ManagerTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls) -> None:
        rospy.init_node("test_manager")
        cls.log = LogWatch()

    def setUp(self) -> None:
        self.orders: list[RequestGatewayDroneFlight] = []
        self.sharing: list[int] = []  # the drones that were ordered onto others' places

    def listen(
        self, no_route: Container[int] = (), taken: Mapping[int, int] = MappingProxyType({})
    ) -> None:
        """Subscribe as a gateway does, and answer. Orders to drone 250 show that they arrive.

        `taken`: by whom the place of an order is taken.
        """
        answers = rospy.Publisher("/gateway/answers", FlightOrderAnswer, queue_size=100)
        wait_for("the manager to subscribe", 10, lambda: answers.get_num_connections() > 0)
        trials: list[RequestGatewayDroneFlight] = []

        def order(order: RequestGatewayDroneFlight) -> None:
            (trials if order.ID == 250 else self.orders).append(order)
            if order.ID in taken:
                by = taken[order.ID]
                why = f"drone {by} stands there"
                answers.publish(0, order.ID, FlightOrderAnswer.PLACE_TAKEN, why, by)
                return
            lost = order.ID in no_route
            outcome = FlightOrderAnswer.NO_ROUTE if lost else FlightOrderAnswer.SENT
            answers.publish(FlightOrderAnswer(gateway=0, drone=order.ID, outcome=outcome))

        def share(order: RequestGatewayDroneFlight) -> None:
            self.sharing.append(order.ID)
            answers.publish(FlightOrderAnswer(0, order.ID, FlightOrderAnswer.SENT, "", 0))

        for topic, take in (("/gateway", order), ("/gateway/shared_place", share)):
            gateway = rospy.Subscriber(topic, RequestGatewayDroneFlight, take)
            self.addCleanup(gateway.unregister)
            wait_for("the manager to connect", 10, lambda at=gateway: at.get_num_connections() > 0)
        wait_for("no order arrived", 10, lambda: request(250, 1, 1, 1) == 1 and trials)

    def test_an_order_reaches_the_gateway_as_it_was_given(self) -> None:
        self.listen()
        self.assertEqual(request(3, 4.5, -2.25, 7), 1)
        wait_for("the order did not arrive", 5, lambda: self.orders)
        order = self.orders[0]
        self.assertEqual((order.ID, order.latitude, order.longitude), (3, 4.5, -2.25))
        self.assertEqual(order.height, 7)

    def test_an_order_that_no_gateway_has_a_route_for_has_status_2(self) -> None:
        self.listen(no_route=[3])
        self.assertEqual(request(3, 1, 1, 0), 2)
        self.assertEqual(request(4, 1, 1, 0), 1)
        wait_for("a line", 5, lambda: self.log.lines("drone 3: no gateway has a route to it"))

    def test_an_order_onto_the_place_of_another_drone_is_refused_unless_it_says_so(self) -> None:
        self.listen(taken={3: 5})
        with self.assertRaisesRegex(rospy.ServiceException, "drone 5 stands there"):
            request(3, 1, 1, 0)
        with self.assertRaisesRegex(rospy.ServiceException, "drone 5 stands there"):
            call("/DroneManager/orderFlight", OrderFlight, 3, 1, 1, 0, False)
        self.assertEqual(self.sharing, [])
        self.assertTrue(call("/DroneManager/orderFlight", OrderFlight, 3, 1, 1, 0, True).success)
        self.assertEqual(self.sharing, [3])

    def test_in_a_layout_a_place_that_another_of_its_drones_leaves_is_free(self) -> None:
        self.listen(taken={6: 5, 3: 99})
        answer = call("/DroneManager/orderLayout", OrderLayout, 101, True)
        self.assertEqual(self.sharing, [6])
        self.assertEqual(list(answer.sent), [5, 4, 2, 1, 6])
        reason = "drone 3 stays: drone 99 stands there"
        self.assertEqual(answer.message, f"ordered 5 of 6 drones; {reason}")

    def test_a_gateway_that_does_not_answer_counts_as_one_that_sent(self) -> None:
        silent = rospy.Subscriber("/gateway", RequestGatewayDroneFlight, self.orders.append)
        self.addCleanup(silent.unregister)
        wait_for("an order", 10, lambda: request(250, 1, 1, 1) == 1 and self.orders)

    def test_a_layout_reports_what_became_of_its_orders(self) -> None:
        self.listen(no_route=[2, 5])
        answer = call("/DroneManager/orderLayout", OrderLayout, 101, True)
        self.assertEqual((list(answer.sent), list(answer.no_route)), ([6, 4, 3, 1], [5, 2]))
        self.assertEqual(list(answer.not_in_fleet), [])
        self.assertEqual(answer.message, "ordered 4 of 6 drones; no route yet to drones 2, 5")

    def test_drones_that_are_not_in_the_fleet_are_not_ordered(self) -> None:
        self.listen()
        drones = {"gateways": [0], "routers": [1, 2, 3, 4], "added": [], "hosts": []}
        rospy.set_param("/drone_mesh/drones", drones)
        self.addCleanup(rospy.delete_param, "/drone_mesh/drones")
        with self.assertRaisesRegex(
            rospy.ServiceException, "drone 99 is not in this fleet: .* 0..4"
        ):
            request(99, 1, 1, 0)
        call("/DroneManager/SetToCasus", Casus, 101)
        line = "layout 101: ordered 4 of 6 drones; drones 5..6 are not in this fleet"
        wait_for("one line", 5, lambda: self.log.lines(line))
        self.assertEqual([order.ID for order in self.orders], [4, 3, 2, 1])

    def test_the_short_names_do_the_same(self) -> None:
        self.listen()
        self.assertEqual(call("/requestDroneMovement", RequestDroneFlight, 3, 1, 1, 0).status, 1)
        call("/SetToCasus", Casus, 1)
        wait_for("both orders", 5, lambda: [order.ID for order in self.orders] == [3, 1])

    def test_without_a_gateway_the_status_is_0_after_3_seconds(self) -> None:
        begun_s = time.monotonic()
        self.assertEqual(request(3, 1, 1, 0), 0)
        self.assertTrue(2.5 < time.monotonic() - begun_s < 5.0)
        with self.assertRaisesRegex(rospy.ServiceException, "no gateway"):
            call("/DroneManager/SetToCasus", Casus, 101)

    def test_a_layout_is_ordered_from_the_highest_id_down(self) -> None:
        self.listen()
        call("/DroneManager/SetToCasus", Casus, 101)
        wait_for("six orders did not arrive", 5, lambda: len(self.orders) == 6)
        self.assertEqual(
            [(order.ID, order.longitude, order.latitude, order.height) for order in self.orders],
            [
                (6, 3, 16, 0),
                (5, -3, 16, 0),
                (4, 3, 10, 0),
                (3, -3, 10, 0),
                (2, 3, 4, 0),
                (1, -3, 4, 0),
            ],
        )

    def test_a_formation_is_ordered_as_a_layout_is(self) -> None:
        self.listen(no_route=[4])
        places = [Location(1.5, 2.5, 3), Location(4.5, 5.5, 0)]
        answer = call(
            "/DroneManager/orderFormation", OrderFormation, "field.kml", [3, 4], places, True, []
        )
        self.assertEqual((list(answer.sent), list(answer.no_route)), ([3], [4]))
        self.assertEqual(answer.message, "ordered 1 of 2 drones; no route yet to drone 4")
        order = self.orders[-1]
        self.assertEqual([order.ID for order in self.orders], [4, 3])
        self.assertEqual((order.latitude, order.longitude, order.height), (1.5, 2.5, 3))
        for drones, name, why in (
            ([3, 3], "a", "each once"),
            ([3], "a", "a place for each"),
            ([3, 254], "a", "invalid drone id 254"),
            ([3, 4], "a\n", "printable"),
        ):
            with self.assertRaisesRegex(rospy.ServiceException, why):
                call("/DroneManager/orderFormation", OrderFormation, name, drones, places, True, [])

    def test_places_of_a_layout_that_are_too_near_to_each_other_are_refused(self) -> None:
        self.listen()
        name = "/DroneManager/orderFormation"
        for away_m, at_once in ((0.0, True), (0.01, True), (0.9, False)):
            places = [Location(5.0, 5.0, 0), Location(5.0, 5.0 + away_m, 0)]
            why = f"drones 3 and 4 would stand {away_m:.2f} m apart: the clearance is 1 m"
            with self.assertRaisesRegex(rospy.ServiceException, why):
                call(name, OrderFormation, "near", [3, 4], places, at_once, [])
        places = [Location(5.0, 5.0, 0), Location(5.0, 6.0, 0)]
        self.assertTrue(call(name, OrderFormation, "apart", [3, 4], places, True, []).sent)
        self.assertEqual([order.ID for order in self.orders], [4, 3])

    def test_what_is_no_order_is_refused_with_a_reason(self) -> None:
        self.listen()
        for arguments, why in (
            ((3, math.nan, 1, 0), "latitude nan"),
            ((3, 1, math.inf, 0), "longitude inf"),
            ((3, 5001, 1, 0), "latitude 5001 m is outside"),
            ((3, 1, 1, -1), "height -1 m is outside"),
            ((3, 1, 1, 501), "height 501 m is outside"),
            ((254, 1, 1, 0), "invalid drone id 254: must be 0..253"),
            ((255, 1, 1, 0), "invalid drone id 255: must be 0..253"),
        ):
            with self.assertRaisesRegex(rospy.ServiceException, why):
                request(*arguments)
        with self.assertRaisesRegex(
            rospy.ServiceException, r"unknown case 99: use one of 0\.\.17, 100"
        ):
            call("/DroneManager/SetToCasus", Casus, 99)
        self.assertEqual(request(9, 1, 1, 1), 1)
        wait_for("the good order did not arrive", 5, lambda: self.orders)
        self.assertEqual([order.ID for order in self.orders], [9])
        self.assertEqual(self.log.failures(), [])


if __name__ == "__main__":
    rostest.rosrun("drone_mesh", "manager", ManagerTest)
