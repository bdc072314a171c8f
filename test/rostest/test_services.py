#!/usr/bin/env python3
"""DroneManager and WirelessSignalSimulator without a mesh: topics, services and honest answers."""

from __future__ import annotations

import math
import os
import signal
import subprocess
import sys
import time
import unittest
from types import MappingProxyType
from typing import Container, Mapping

import rospy
import rostest
from diagnostic_msgs.msg import DiagnosticArray
from rostest_support import WALL_LIMIT_S, LogWatch, Stranger, call, in_order, wait_for

from drone_mesh.msg import NRF24, DroneInfo, FlightOrderAnswer, Location, RequestGatewayDroneFlight
from drone_mesh.srv import (
    AreaScan,
    Broadcast,
    Casus,
    OrderFlight,
    OrderFormation,
    OrderLayout,
    RequestDroneFlight,
    WirelessMessages,
)

# A receiver in a process of its own, to be killed.
RECEIVER = """
import rospy, sys
from drone_mesh.msg import NRF24
rospy.init_node("receiver", anonymous=True)
rospy.Subscriber("/victim", NRF24, lambda packet: None)
rospy.spin()
"""


def packet(from_: int, to: int) -> bytes:
    return bytes((from_, from_, 200, to, to))


class SimulatorTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls) -> None:
        cls.log = LogWatch()
        cls.a = Stranger(1, "/stranger_a", (1.0, 0.0, 0.1))
        cls.b = Stranger(2, "/stranger_b", (5.0, 0.0, 0.1))
        cls.far = Stranger(3, "/stranger_far", (10.5, 0.0, 0.1))
        for stranger in (cls.a, cls.b, cls.far):
            stranger.register()

    def setUp(self) -> None:
        for stranger in (self.a, self.b, self.far):
            stranger.heard.clear()

    def in_range(self, node_id: int) -> list[int]:
        return list(call("/SignalSimulator/othersinRange", AreaScan, node_id).near)

    def knows(self, node_id: int) -> bool:
        try:
            self.in_range(node_id)
        except rospy.ServiceException:
            return False
        return True

    def figure(self, name: str) -> float:
        """The figures that the simulator publishes after this call."""
        heard: list[float] = []
        for _message in range(2):  # the first may have been sent before the call
            array = rospy.wait_for_message("/diagnostics", DiagnosticArray, WALL_LIMIT_S)
            heard += [float(v.value) for s in array.status for v in s.values if v.key == name]
        return heard[-1]

    def test_a_node_out_of_range_or_unknown_is_not_reached(self) -> None:
        self.assertFalse(self.a.send(packet(1, 3)))
        self.assertFalse(self.a.send(packet(1, 77)))
        self.assertFalse(self.a.send(packet(77, 1)))

    def test_an_unknown_asker_gets_a_service_error_that_says_so(self) -> None:
        with self.assertRaisesRegex(rospy.ServiceException, "node 77 is not registered"):
            self.in_range(77)

    def test_a_broadcast_reaches_all_in_range_each_with_its_own_id(self) -> None:
        message = NRF24(bytes((2, 2, 200, 254, 254)).ljust(32, b"\x07"))
        reached = call("/SignalSimulator/broadcast", Broadcast, 2, message).reached
        self.assertEqual(list(reached), [1, 3])
        for stranger in (self.a, self.far):
            got = stranger.wait_for_packet(b"\x02\x02\xc8", "the broadcast did not arrive")
            self.assertEqual(got, bytes((2, 2, 200, stranger.node_id, 254)).ljust(32, b"\x07"))
        self.assertEqual(self.b.heard, [])

    def test_packets_handed_over_together_each_go_to_their_receiver(self) -> None:
        near, unknown, far = packet(1, 2), packet(1, 77), packet(1, 3)
        joined = b"".join(part.ljust(32, b"\x05") for part in (near, unknown, far, near))
        taken = call("/SignalSimulator/messages", WirelessMessages, 1, joined).succes
        self.assertEqual(list(taken), [True, False, False, True])
        got = self.b.wait_for_packet(near, "the packet for 2 did not arrive")
        self.assertEqual(got, near.ljust(32, b"\x05"))
        self.assertEqual(self.far.heard, [])
        with self.assertRaisesRegex(rospy.ServiceException, "33 bytes: expected 32 per packet"):
            call("/SignalSimulator/messages", WirelessMessages, 1, bytes(33))

    def test_a_node_that_is_off_neither_sends_nor_receives(self) -> None:
        self.b.announce((0.0, 0.0, 0.0), "/stranger_b", on=False)
        wait_for("2 was not switched off", 5, lambda: self.in_range(1) == [])
        self.assertFalse(self.a.send(packet(1, 2)))
        self.assertFalse(self.b.send(packet(2, 1)))
        self.b.announce((0.0, 0.0, 0.0), "/stranger_b", on=True)
        wait_for("2 was not switched on", 5, lambda: self.in_range(1) == [2])

    def test_a_killed_receiver_does_not_count_as_reached(self) -> None:
        receiver = subprocess.Popen([sys.executable, "-c", RECEIVER])
        try:
            self.a._publisher.publish(DroneInfo(9, (1.5, 0.0, 0.1), "/victim", True))
            wait_for("9 could not be sent to", 10, lambda: self.a.send(packet(1, 9)))
            os.kill(receiver.pid, signal.SIGKILL)
            receiver.wait()
            self.assertFalse(self.a.send(packet(1, 9)), "the first packet after its death")
            self.assertNotIn(9, self.in_range(1))
        finally:
            receiver.kill()
            receiver.wait()

    def test_only_a_node_that_has_listened_before_can_lose_a_packet(self) -> None:
        late = Stranger(8, "/stranger_late", (1.0, 1.0, 0.1))
        late.subscriber.unregister()
        late.announce((1.0, 1.0, 0.1), "/stranger_late")
        wait_for("8 is known", WALL_LIMIT_S, lambda: self.knows(8))
        lost = self.figure("lost in range")
        self.assertFalse(self.a.send(packet(1, 8)))
        self.assertEqual(self.figure("lost in range"), lost)

        subscriber = rospy.Subscriber("/stranger_late", NRF24, lambda _packet: None)
        wait_for("8 listens", WALL_LIMIT_S, lambda: self.a.send(packet(1, 8)))
        subscriber.unregister()
        wait_for("8 no longer listens", WALL_LIMIT_S, lambda: not self.a.send(packet(1, 8)))
        self.assertGreater(self.figure("lost in range"), lost)
        late.announce((0.0, 0.0, 0.0), "/stranger_late", on=False)

    def test_bad_information_changes_nothing_and_does_not_flood_the_log(self) -> None:
        nan = float("nan")
        for _ in range(50):
            self.a._publisher.publish(DroneInfo(1, (nan, 0.0, 0.0), "", True))
            self.a._publisher.publish(DroneInfo(254, (1.0, 0.0, 0.0), "/Node/254", True))
            self.a._publisher.publish(DroneInfo(255, (1.0, 0.0, 0.0), "", True))
            self.a._publisher.publish(DroneInfo(1, (1.0, 0.0, 0.0), "no topic", True))
            self.a._publisher.publish(DroneInfo(1, (1.0, 0.0, 0.0), "/rosout", True))
        self.far.announce((9.0, 0.0, 0.1))  # comes after them on the same connection
        wait_for("3 did not move", WALL_LIMIT_S, lambda: self.in_range(1) == [2, 3])
        self.far.announce((10.5, 0.0, 0.1))
        wait_for("3 did not move back", WALL_LIMIT_S, lambda: self.in_range(1) == [2])
        wait_for("no line about it", 10, lambda: self.log.lines("DroneInfo dropped"))
        self.assertTrue(self.b.send(packet(2, 1)))
        self.assertLessEqual(len(self.log.lines("DroneInfo dropped")), 2)
        self.assertEqual(self.log.failures(), [])


def request(node_id: int, latitude: float, longitude: float, height: int) -> int:
    place = (latitude, longitude, height)
    return call("/DroneManager/requestDroneMovement", RequestDroneFlight, node_id, *place).status


class ManagerTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls) -> None:
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

    def test_without_a_gateway_the_status_is_0_after_3_seconds(self) -> None:
        begun_s = time.monotonic()
        self.assertEqual(request(3, 1, 1, 0), 0)
        self.assertTrue(2.5 < time.monotonic() - begun_s < 5.0)
        with self.assertRaisesRegex(rospy.ServiceException, "no gateway"):
            call("/DroneManager/SetToCasus", Casus, 101)

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


def suite() -> unittest.TestSuite:
    return in_order(SimulatorTest, ManagerTest)


if __name__ == "__main__":
    rospy.init_node("test_services")
    rostest.rosrun("drone_mesh", "services", "__main__.suite")
