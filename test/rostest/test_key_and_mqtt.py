#!/usr/bin/env python3
"""With key:= and internet:=mqtt: sealed packets, and users' data that pass through a broker."""

from __future__ import annotations

import queue
import shutil
import signal
import subprocess
import tempfile
import threading
import time
import unittest
from pathlib import Path

import paho.mqtt.client as mqtt
import rospy
import rostest
from paho.mqtt.enums import CallbackAPIVersion
from rostest_support import WALL_LIMIT_S, MeshWatch, call, free_port, wait_for

from drone_mesh.communication.seals.keys import MeshKey, write_key_file
from drone_mesh.msg import NRF24
from drone_mesh.ros.graph import names
from drone_mesh.srv import RequestDroneFlight, SendData

GATEWAY = 255
MOSQUITTO = shutil.which("mosquitto") or shutil.which("mosquitto", path="/usr/sbin")
FORGED_ORDER = bytes.fromhex("0000060101000020410000a04000000000").ljust(32, b"\0")  # to drone 1


class KeyAndMqttTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls) -> None:
        assert MOSQUITTO is not None, "no broker is installed: apt install mosquitto"
        cls.port = free_port()
        folder = tempfile.TemporaryDirectory()
        cls.addClassCleanup(folder.cleanup)
        settings, key_file = Path(folder.name) / "mosquitto.conf", Path(folder.name) / "mesh.key"
        settings.write_text(f"listener {cls.port} 127.0.0.1\nallow_anonymous true\n")
        write_key_file(key_file, MeshKey(bytes(range(16))))
        cls.start(MOSQUITTO, "-c", str(settings))
        cls.messages: queue.Queue[mqtt.MQTTMessage] = queue.Queue()
        cls.client = mqtt.Client(CallbackAPIVersion.VERSION2, client_id="test")
        cls.client.on_message = lambda _client, _data, message: cls.messages.put(message)
        # On each connection: a broken one takes its subscriptions along.
        cls.client.on_connect = lambda *_: cls.client.subscribe("drone_mesh/test/#", 1)
        subscribed = threading.Event()
        cls.client.on_subscribe = lambda *_: subscribed.set()
        wait_for("no broker", WALL_LIMIT_S, cls.connects)
        cls.client.loop_start()
        cls.addClassCleanup(cls.client.loop_stop)
        cls.addClassCleanup(cls.client.disconnect)
        assert subscribed.wait(WALL_LIMIT_S), "the broker did not confirm the subscription"
        broker = f"broker:=mqtt://127.0.0.1:{cls.port}/test"
        factory = ("roslaunch", "drone_mesh", "factory.launch", "routers:=4")
        cls.start(*factory, f"key:={key_file}", "internet:=mqtt", broker, "real_time_factor:=4")
        cls.mesh = MeshWatch(5)
        wait_for("no clock", WALL_LIMIT_S, lambda: rospy.get_time() > 0.0)
        cls.mesh.wait("all connected", 60, cls.mesh.connected)

    @classmethod
    def start(cls, *command: str) -> None:
        process = subprocess.Popen(command)
        cls.addClassCleanup(process.wait)
        cls.addClassCleanup(process.send_signal, signal.SIGTERM)

    @classmethod
    def connects(cls) -> bool:
        try:
            cls.client.connect("127.0.0.1", cls.port)
        except ConnectionRefusedError:
            return False
        return True

    def next(self, topic: str) -> bytes:
        deadline_s = time.monotonic() + WALL_LIMIT_S
        while True:
            try:
                message = self.messages.get(timeout=max(0.01, deadline_s - time.monotonic()))
            except queue.Empty:
                self.fail(f"nothing came on {topic}")
            if message.topic == f"drone_mesh/test/{topic}":
                return message.payload

    def test_1_data_passes_both_ways_between_the_nodes_and_the_broker(self) -> None:
        sent = call("/Nodes/2/send", SendData, GATEWAY, 7, True, b"21.5", 20.0)
        self.assertTrue(sent.success, sent.message)
        self.assertEqual(self.next("2/rx/7"), b"21.5")
        self.client.publish("drone_mesh/test/1/tx", b"blink", 1)
        self.assertIn(b'"delivered"', self.next("1/event"))

    def test_2_an_order_from_the_gateway_is_obeyed_and_a_forged_one_is_not(self) -> None:
        mesh, heard = self.mesh, []
        rospy.Subscriber(names.node_topic(1), NRF24, lambda message: heard.append(message.payload))
        forge = rospy.Publisher(names.node_topic(1), NRF24, queue_size=10)
        mesh.wait("packets for node 1", 60, lambda: len(heard) > 10)
        of_others = [payload for payload in heard if payload[1] != 1]
        self.assertTrue(all(any(payload[25:]) for payload in of_others), "packets without a seal")
        # The subscriptions of this test and of node 1.
        wait_for("node 1 to hear the forger", WALL_LIMIT_S, lambda: forge.get_num_connections() > 1)
        place = mesh.place(1)
        for _ in range(5):
            forge.publish(NRF24(FORGED_ORDER))
        mesh.pass_time(5.0)
        self.assertEqual(mesh.place(1), place, "a forged order was obeyed")
        call("/DroneManager/requestDroneMovement", RequestDroneFlight, 1, 3.0, 2.0, 0)
        mesh.wait_at(1, 2.0, 3.0, 30)


if __name__ == "__main__":
    rospy.init_node("test_key_and_mqtt")
    rostest.rosrun("drone_mesh", "key_and_mqtt", KeyAndMqttTest)
