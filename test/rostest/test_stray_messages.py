#!/usr/bin/env python3
"""Foreign DroneInfo, and subscribers that never read, neither cut off a node nor slow the world."""

from __future__ import annotations

import socket
import struct
import subprocess
import unittest
from xmlrpc.client import ServerProxy

import psutil
import rosgraph
import rospy
import rostest
from rosgraph_msgs.msg import Clock
from rostest_support import WALL_LIMIT_S, LogWatch, MeshWatch, pid_of, wait_for
from std_msgs.msg import String

from drone_mesh.msg import DroneInfo
from drone_mesh.ros.graph.direct_publisher import DirectPublisher
from drone_mesh.ros.world.world_runner import STUCK_SUBSCRIBER_S

STUCK = 30
LARGE_BYTES = 100_000
TAKEN_AWAY = "/taken/away"
AGAIN_AND_AGAIN = "/taken/again"


def subscribe_and_never_read(
    name: str, node: str = "/DroneFactory", topic: str = "/clock", kind: type = Clock
) -> socket.socket:
    """A subscriber that shakes hands and then leaves everything in its buffer."""
    publisher = ServerProxy(rosgraph.Master("/test").lookupNode(node))
    _code, _text, protocol = publisher.requestTopic(name, topic, [["TCPROS"]])
    _tcpros, host, port = protocol
    connection = socket.socket()
    connection.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 2048)
    connection.connect((host, port))
    fields = {"callerid": name, "topic": topic, "type": kind._type}
    lines = [f"{k}={v}".encode() for k, v in {**fields, "md5sum": kind._md5sum}.items()]
    header = b"".join(struct.pack("<I", len(line)) + line for line in lines)
    connection.sendall(struct.pack("<I", len(header)) + header)
    return connection


def published_topics() -> set[str]:
    return {topic for topic, _type in rospy.get_published_topics()}


class StrayMessagesTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls) -> None:
        rospy.init_node("test_stray_messages")
        cls.log = LogWatch()
        cls.mesh = MeshWatch(3)
        cls.mesh.wait("all connected", 30, cls.mesh.connected)

    def test_a_node_whose_packets_were_redirected_recovers_by_itself(self) -> None:
        publisher = rospy.Publisher("/WirelessSignalSimulator", DroneInfo, queue_size=10)
        wait_for("the simulator", WALL_LIMIT_S, lambda: publisher.get_num_connections() > 0)
        publisher.publish(DroneInfo(2, (0.0, 0.0, 0.0), TAKEN_AWAY, True))
        wait_for("a line about it", WALL_LIMIT_S, lambda: self.log.lines(TAKEN_AWAY))
        self.assertIn("topic changed: node 2: from /Node/2", self.log.lines(TAKEN_AWAY)[0])
        wait_for("its own topic again", WALL_LIMIT_S, lambda: TAKEN_AWAY not in published_topics())
        sent = self.mesh.info(2).totalMessages
        self.mesh.wait(
            "2 sends and is connected",
            40,
            lambda: self.mesh.info(2).totalMessages > sent and self.mesh.connected(),
        )
        self.assertEqual(self.log.failures(), [])

    def test_two_announcers_that_disagree_about_a_topic_leave_it_open_in_the_end(self) -> None:
        def announce_for_ever(topic: str) -> subprocess.Popen[bytes]:
            info = f"{{nodeID: 2, sub: {topic}, 'on': true}}"
            command = ["rostopic", "pub", "-r", "500", "/WirelessSignalSimulator"]
            announcer = subprocess.Popen([*command, "drone_mesh/DroneInfo", info])
            self.addCleanup(announcer.wait)
            self.addCleanup(announcer.terminate)
            return announcer

        announcers = [announce_for_ever(topic) for topic in (AGAIN_AND_AGAIN, "/Node/2")]
        wait_for(
            "another topic for 2",
            WALL_LIMIT_S,
            lambda: AGAIN_AND_AGAIN in published_topics(),
        )
        self.mesh.pass_time(20.0)
        for announcer in announcers:
            announcer.terminate()
        wait_for("its own topic", WALL_LIMIT_S, lambda: AGAIN_AND_AGAIN not in published_topics())
        self.assertIn("/Node/2", published_topics())
        self.mesh.wait("all connected again", 40, self.mesh.connected)

    def test_subscribers_of_the_clock_that_never_read_cost_the_world_no_thread(self) -> None:
        factory = psutil.Process(pid_of("/DroneFactory"))
        before = factory.num_threads()
        stuck = [subscribe_and_never_read(f"/stuck_{number}") for number in range(STUCK)]
        self.addCleanup(lambda: [connection.close() for connection in stuck])
        for connection in stuck:  # the publisher's header comes first, then the ticks
            self.assertGreater(len(connection.recv(1)), 0)
        self.assertLess(factory.num_threads(), before + STUCK // 2)
        now_s = rospy.get_time()
        wait_for("the clock to go on", WALL_LIMIT_S, lambda: rospy.get_time() > now_s + 1.0)

    def test_a_subscriber_that_never_reads_is_dropped_and_the_others_get_everything(self) -> None:
        """With the publisher of /clock, and messages that soon fill the kernel's buffers."""
        publisher = DirectPublisher("/large", String, STUCK_SUBSCRIBER_S)
        self.addCleanup(publisher.close)
        heard: list[String] = []
        reader = rospy.Subscriber("/large", String, heard.append)
        self.addCleanup(reader.unregister)
        stuck = subscribe_and_never_read("/stuck", rospy.get_name(), "/large", String)
        self.addCleanup(stuck.close)
        wait_for("both", WALL_LIMIT_S, lambda: len(publisher.connections()) == 2)
        for sent in range(1, 1001):
            publisher.publish(String("." * LARGE_BYTES))
            wait_for("the reader has it", WALL_LIMIT_S, lambda: len(heard) == sent)  # noqa: B023
            if len(publisher.connections()) == 1:
                break
        self.assertEqual(len(publisher.connections()), 1, "the stuck subscriber was not dropped")


if __name__ == "__main__":
    rostest.rosrun("drone_mesh", "stray_messages", StrayMessagesTest)
