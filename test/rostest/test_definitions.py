#!/usr/bin/env python3
"""The ROS definitions are a wire contract: programs built against those of 2019 still work."""

from __future__ import annotations

import unittest

import rostest

from drone_mesh import msg, srv

MESSAGES = {
    "DroneInfo": "99e674e5b5a4182824586263d617f84a",
    "Location": "531a36c12f67bc070739cea93f21680c",
    "NRF24": "a180fb3b6d78327c70980534ae536e9c",
    "NodeDebugInfo": "b141338f1e7694ff1b6289d9fdd9b17d",
    "RequestGatewayDroneFlight": "cae8e186407a89969bcd102090752de9",
}
SERVICES = {
    "AreaScan": "ebc855433e55277d7ff08f155e929271",
    "Casus": "793016ca784a646cc1bb4549c63c4736",
    "PowerSwitch": "d1b2ea3f5a3f173007e2e47568b40871",
    "RequestDroneFlight": "51562573c0dba53c9030c27c5521346f",
    "RequestGPS": "531a36c12f67bc070739cea93f21680c",
    "WirelessMessage": "7675f18cd7ea62a81bf259a443d1ffd3",
}


class DefinitionsTest(unittest.TestCase):
    def test_messages_have_the_md5_sums_of_2019(self) -> None:
        self.assertEqual({name: getattr(msg, name)._md5sum for name in MESSAGES}, MESSAGES)

    def test_services_have_the_md5_sums_of_2019(self) -> None:
        self.assertEqual({name: getattr(srv, name)._md5sum for name in SERVICES}, SERVICES)


if __name__ == "__main__":
    rostest.rosrun("drone_mesh", "definitions", DefinitionsTest)
