#!/usr/bin/env python3
"""What a gateway and two routers are enough for, in one launch, one class after the other."""

from __future__ import annotations

import unittest

import rospy
import rostest
from rostest_support import in_order
from test_factory import FactoryTest
from test_fleet_changes import FleetChangesTest, FlyActionsTest
from test_strangers import ExamplesTest, StrangersTest, UsersDataTest


def suite() -> unittest.TestSuite:
    # The first follows each tick of the clock, as it can only before the others rest between them.
    return in_order(
        *(FactoryTest, StrangersTest, UsersDataTest, ExamplesTest),
        *(FlyActionsTest, FleetChangesTest),
    )


if __name__ == "__main__":
    rospy.init_node("test_two_routers")
    rostest.rosrun("drone_mesh", "two_routers", "__main__.suite")
