#!/usr/bin/env python3
"""With internet:=mqtt users' data passes between the nodes of a simulation and a broker."""

from __future__ import annotations

import queue
import shutil
import signal
import socket
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
from rostest_support import WALL_LIMIT_S, MeshWatch, call, wait_for

from drone_mesh.srv import SendData

GATEWAY = 255
MOSQUITTO = shutil.which("mosquitto") or shutil.which("mosquitto", path="/usr/sbin")


class MqttTest(unittest.TestCase):
    def setUp(self) -> None:
        assert MOSQUITTO is not None, "no broker is installed: apt install mosquitto"
        with socket.socket() as probe:
            probe.bind(("127.0.0.1", 0))
            self.port = probe.getsockname()[1]
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        settings = Path(folder.name) / "mosquitto.conf"
        settings.write_text(f"listener {self.port} 127.0.0.1\nallow_anonymous true\n")
        self.start([MOSQUITTO, "-c", str(settings)])
        self.messages: queue.Queue[mqtt.MQTTMessage] = queue.Queue()
        self.client = mqtt.Client(CallbackAPIVersion.VERSION2, client_id="test")
        self.client.on_message = lambda _client, _data, message: self.messages.put(message)
        # On each connection: a broken one takes its subscriptions along.
        self.client.on_connect = lambda *_: self.client.subscribe("drone_mesh/test/#", 1)
        subscribed = threading.Event()
        self.client.on_subscribe = lambda *_: subscribed.set()
        wait_for("no broker", WALL_LIMIT_S, self.connects)
        self.client.loop_start()
        self.addCleanup(self.client.loop_stop)
        self.addCleanup(self.client.disconnect)
        self.assertTrue(
            subscribed.wait(WALL_LIMIT_S), "the broker did not confirm the subscription"
        )
        broker = f"broker:=mqtt://127.0.0.1:{self.port}/test"
        command = ["roslaunch", "drone_mesh", "factory.launch", "routers:=2", "internet:=mqtt"]
        self.start([*command, broker])

    def start(self, command: list[str]) -> None:
        process = subprocess.Popen(command)
        self.addCleanup(process.wait)
        self.addCleanup(process.send_signal, signal.SIGTERM)

    def connects(self) -> bool:
        try:
            self.client.connect("127.0.0.1", self.port)
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

    def test_data_passes_both_ways(self) -> None:
        rospy.init_node("test_mqtt")
        mesh = MeshWatch(3)
        wait_for("no clock", WALL_LIMIT_S, lambda: rospy.get_time() > 0.0)
        mesh.wait("all connected", 60, mesh.connected)
        sent = call("/Nodes/2/send", SendData, GATEWAY, 7, True, b"21.5", 20.0)
        self.assertTrue(sent.success, sent.message)
        self.assertEqual(self.next("2/rx/7"), b"21.5")
        self.client.publish("drone_mesh/test/1/tx", b"blink", 1)
        self.assertIn(b'"delivered"', self.next("1/event"))


if __name__ == "__main__":
    rostest.rosrun("drone_mesh", "mqtt", MqttTest)
