#!/usr/bin/env python3
"""Simulated drones with the real driver on emulated chips, and a gateway's HTTP side."""

from __future__ import annotations

import json
import unittest
import urllib.error
import urllib.request

import rospy
import rostest
from rostest_support import WALL_LIMIT_S, LogWatch, MeshWatch, call, wait_for

from drone_mesh.msg import NRF24, PacketSample
from drone_mesh.srv import AddDrone, RemoveDrone

GATEWAY_URL = "http://127.0.0.1:9080"
ANSWER_WITHIN_S = 5.0


def order(drone: int, latitude: float, longitude: float, height: int) -> int:
    """POST an order; returns the HTTP status."""
    where = f"{GATEWAY_URL}/DroneMovement/{drone}/{latitude}/{longitude}/{height}"
    request = urllib.request.Request(where, method="POST", data=b"")
    try:
        with urllib.request.urlopen(request, timeout=ANSWER_WITHIN_S) as answer:
            return answer.status
    except urllib.error.HTTPError as error:
        return error.code


class EmulatedRadioTest(unittest.TestCase):
    def test_drones_on_emulated_chips_connect_over_hops_and_take_orders_over_http(self) -> None:
        rospy.init_node("test_emulated_radio")
        log = LogWatch()
        mesh = MeshWatch(6)
        received: list[NRF24] = []
        rospy.Subscriber("/Node/2", NRF24, received.append)
        packets: set[tuple[int, int]] = set()  # the hops of those that were sampled
        rospy.Subscriber(
            "/mesh/packets", PacketSample, lambda m: packets.update(zip(m.senders, m.receivers))
        )
        mesh.wait("all connected over the chips", 30, mesh.connected)
        # If a frame is lost at the start, a node uses a longer route until its next checks.
        shortest = {0: 0, 1: 1, 2: 1, 3: 2, 4: 3, 5: 4}
        mesh.wait("the shortest routes", 45, lambda: mesh.hops() == shortest)
        wait_for("a packet from 3 to 2 in a sample", WALL_LIMIT_S, lambda: (3, 2) in packets)
        wait_for("/Node/2 shows what was received", WALL_LIMIT_S, lambda: received)

        with urllib.request.urlopen(f"{GATEWAY_URL}/nodes", timeout=ANSWER_WITHIN_S) as answer:
            known = {node["id"] for node in json.load(answer)["nodes"]}
        self.assertLessEqual({1, 2}, known)
        self.assertEqual(order(200, 1.0, 1.0, 0), 503, "an order without a route")
        self.assertEqual(order(1, 1e9, 1.0, 0), 422, "a place out of bounds")

        self.assertLess(order(5, 3.0, 24.0, 0), 300)
        mesh.wait_at(5, 24.0, 3.0, within_s=60)
        mesh.wait("drone 5 connected again", 30, lambda: mesh.connected([5]))

        mesh.switch(4, False)
        mesh.wait("4 and 5, which is behind it, lost", 30, lambda: mesh.lost(4, 5))
        mesh.switch(4, True)
        mesh.wait("all connected again", 60, mesh.connected)

        added = call("/DroneFactory/addDrone", AddDrone, 9, False, 6.0, 0.0)
        self.assertTrue(added.success, added.message)
        newcomer = MeshWatch(10)
        newcomer.wait("the added drone connected", 60, lambda: newcomer.connected([9]))
        removed = call("/DroneFactory/removeDrone", RemoveDrone, 9)
        self.assertTrue(removed.success, removed.message)
        self.assertEqual(log.failures(), [])


if __name__ == "__main__":
    rostest.rosrun("drone_mesh", "emulated_radio", EmulatedRadioTest)
