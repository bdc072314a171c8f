#!/usr/bin/env python3
"""The WirelessSignalSimulator alone: its topic, its services, and honest answers."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import unittest

import rospy
import rostest
from diagnostic_msgs.msg import DiagnosticArray
from rostest_support import WALL_LIMIT_S, LogWatch, Stranger, call, wait_for

from drone_mesh.msg import NRF24, DroneInfo
from drone_mesh.srv import AreaScan, Broadcast, WirelessMessages

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
        rospy.init_node("test_simulator")
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

    def test_a_packet_reaches_the_topic_of_its_receiver_unchanged(self) -> None:
        sent = packet(1, 2) + bytes(range(27))
        self.assertTrue(self.a.send(sent))
        self.assertEqual(self.b.wait_for_packet(packet(1, 2), "the packet did not arrive"), sent)
        self.assertEqual(self.far.heard, [])

    def test_a_node_out_of_range_or_unknown_is_not_reached(self) -> None:
        self.assertFalse(self.a.send(packet(1, 3)))
        self.assertFalse(self.a.send(packet(1, 77)))
        self.assertFalse(self.a.send(packet(77, 1)))

    def test_others_in_range_are_named_without_the_asker(self) -> None:
        self.assertEqual(self.in_range(1), [2])
        self.assertEqual(self.in_range(2), [1, 3])

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

    def test_an_engine_moves_its_node(self) -> None:
        self.far.announce((9.0, 0.0, 0.1))
        wait_for("3 did not move", 5, lambda: self.in_range(1) == [2, 3])
        self.far.announce((10.5, 0.0, 0.1))
        wait_for("3 did not move back", 5, lambda: self.in_range(1) == [2])

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


if __name__ == "__main__":
    rostest.rosrun("drone_mesh", "simulator", SimulatorTest)
