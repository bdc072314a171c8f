"""A foreign node sends random packets; users' data, and the examples."""

from __future__ import annotations

import random
import subprocess
import sys
import unittest
from pathlib import Path

import rospy
from rostest_support import (
    WALL_LIMIT_S,
    LogWatch,
    MeshWatch,
    Stranger,
    call,
    receives,
    wait_for,
)

from drone_mesh.msg import NRF24, MeshState, ReceivedData
from drone_mesh.srv import PowerSwitch, SendData, WirelessMessage

PACKETS = 1_000
REQUESTLOCATION, LOCATION, MOVE_TO_LOCATION = 2, 1, 6
GATEWAY, ROUTER, RANDOM = 0, 1, 100
SEED = 14


def random_packet(rng: random.Random, receiver: int) -> bytes:
    """Half of them random bytes, half of them a valid header with a random body."""
    packet = bytearray(rng.randrange(256) for _ in range(32))
    if rng.random() < 0.5:
        packet[:5] = bytes(
            (RANDOM, RANDOM, rng.randrange(8), receiver, rng.choice((receiver, 254)))
        )
    if packet[2] == MOVE_TO_LOCATION:
        packet[2] = 128
    return bytes(packet)


class StrangersTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls) -> None:
        cls.log = LogWatch()
        cls.mesh = MeshWatch(3)

    def test_a_thousand_random_packets_crash_and_move_nobody_and_all_still_answer(self) -> None:
        log, mesh = self.log, self.mesh
        mesh.wait("all connected", 30, mesh.connected)
        places = [mesh.place(node_id) for node_id in range(3)]
        stranger = Stranger(RANDOM, "/stranger", (0.5, 0.5, 0.1))
        stranger.register()
        self.addCleanup(stranger.leave)

        rng = random.Random(SEED)
        service = rospy.ServiceProxy("/SignalSimulator/message", WirelessMessage, persistent=True)
        for number in range(PACKETS):
            receiver = (GATEWAY, ROUTER)[number % 2]
            message = NRF24(random_packet(rng, receiver))
            self.assertTrue(service(RANDOM, receiver, message).succes, f"packet {number} was lost")

        for receiver in (GATEWAY, ROUTER):
            stranger.heard.clear()
            self.assertTrue(
                stranger.send(bytes((RANDOM, RANDOM, REQUESTLOCATION, receiver, receiver)))
            )
            stranger.wait_for_packet(
                bytes((receiver, receiver, LOCATION, RANDOM, RANDOM)), "no answer"
            )
        mesh.wait("all connected after it", 60, mesh.connected)
        self.assertEqual([mesh.place(node_id) for node_id in range(3)], places)
        self.assertEqual(log.failures(), [])


ANY_GATEWAY = 255


class UsersDataTest(unittest.TestCase):
    def test_a_message_of_a_thousand_bytes_arrives_and_its_sender_knows(self) -> None:
        mesh = MeshWatch(3)
        mesh.wait("all connected", 30, mesh.connected)
        received: list[ReceivedData] = []
        states: list[MeshState] = []
        rospy.Subscriber("/mesh/state", MeshState, states.append)
        subscriber = rospy.Subscriber("/Nodes/0/received", ReceivedData, received.append)
        mesh.wait("node 0's topic", 10, lambda: subscriber.get_num_connections() == 1)
        payload = bytes(n % 256 for n in range(1024))
        answer = call("/Nodes/2/send", SendData, ANY_GATEWAY, 7, True, payload, 20.0)
        self.assertTrue(answer.success, answer.message)
        self.assertEqual(answer.message, "message 1 to the gateway: delivered")
        mesh.wait("the message on node 0's topic", 10, lambda: bool(received))
        message = received[0]
        self.assertEqual((message.sender, message.port, message.payload), (2, 7, payload))
        self.assertGreater(message.header.stamp.to_sec(), 0.0)

        def figures_show() -> bool:
            nodes = {node.id: node for node in states[-1].nodes} if states else {}
            if not {0, 2} <= set(nodes):
                return False
            return (nodes[2].data_sent, nodes[0].data_received) == (1, 1)

        mesh.wait("the message in /mesh/state", 10, figures_show)
        nodes = {node.id: node for node in states[-1].nodes}
        self.assertEqual((nodes[2].data_bytes_sent, nodes[0].data_bytes_received), (1024, 1024))
        self.assertLessEqual(nodes[2].data_sent_at, nodes[0].data_received_at)
        answer = call("/Nodes/2/send", SendData, 1, 7, True, b"across", 20.0)
        self.assertTrue(answer.success, answer.message)
        self.assertEqual(answer.message, "message 2 to node 1: delivered")
        refused = call("/Nodes/2/send", SendData, ANY_GATEWAY, 7, True, payload + b"!", 0.0)
        self.assertFalse(refused.success)
        self.assertIn("too large: 1025 bytes", refused.message)
        for wait in (-1.0, float("nan"), float("inf"), 301.0):
            refused = call("/Nodes/2/send", SendData, ANY_GATEWAY, 7, True, b"x", wait)
            self.assertFalse(refused.success)
            self.assertRegex(refused.message, r"invalid wait .*: must be 0\.\.300 seconds")
            self.assertEqual(refused.ticket, 0)


EXAMPLES = Path(__file__).resolve().parents[2] / "examples"


class ExamplesTest(unittest.TestCase):
    def setUp(self) -> None:
        self.state: MeshState | None = None
        rospy.Subscriber("/mesh/state", MeshState, self._on_state)
        wait_for("all connected", WALL_LIMIT_S, lambda: self.connected() == [0, 1, 2])

    def _on_state(self, state: MeshState) -> None:
        self.state = state

    def connected(self) -> list[int]:
        nodes = self.state.nodes if self.state else []
        return [node.id for node in nodes if node.connected and node.on]

    def start(self, *command: str) -> subprocess.Popen[str]:
        process = subprocess.Popen(
            [sys.executable, str(EXAMPLES / command[0]), *command[1:]],
            stdout=subprocess.PIPE,
            text=True,
        )
        self.addCleanup(process.wait, WALL_LIMIT_S)
        self.addCleanup(process.terminate)
        return process

    def test_1_an_order_is_followed_until_the_drone_has_arrived(self) -> None:
        follower = self.start("fly_and_follow.py", "2", "6", "-1")
        printed, _ = follower.communicate(timeout=WALL_LIMIT_S)
        self.assertEqual(follower.returncode, 0, printed)
        self.assertIn("the drone has accepted it", printed)
        self.assertIn("the drone has arrived", printed)

    def test_2_a_node_that_was_switched_off_is_switched_on_again(self) -> None:
        self.start("react_to_events.py")
        wait_for(
            "the example's subscription",
            WALL_LIMIT_S,
            lambda: receives("/caretaker", "/mesh/events", "/DroneFactory"),
        )
        call("/Nodes/1/powerSwitch", PowerSwitch, False)
        wait_for("1 is off", WALL_LIMIT_S, lambda: self.state and not self.state.nodes[1].on)
        wait_for("1 is on again", WALL_LIMIT_S, lambda: self.state.nodes[1].on)
