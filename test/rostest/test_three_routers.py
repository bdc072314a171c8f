#!/usr/bin/env python3
"""What needs a gateway and three routers in a row, in one launch, one class after the other."""

from __future__ import annotations

import unittest

import rospy
import rostest
from rostest_support import in_order, rest_between_ticks, send_home
from test_document import DocumentTest
from test_mesh_state import MeshStateTest
from test_tools import ToolsTest

from drone_mesh.ros.graph.master import MasterWatch


class BackAtTheStart(unittest.TestCase):
    def test_the_drones_fly_back_to_where_they_started(self) -> None:
        send_home((0.0, 0.0), (6.0, 0.0), (12.0, 0.0))


def suite() -> unittest.TestSuite:
    return in_order(MeshStateTest, BackAtTheStart, DocumentTest, BackAtTheStart, ToolsTest)


if __name__ == "__main__":
    rospy.init_node("test_three_routers")
    rest_between_ticks()
    MasterWatch().start()  # the world registers its topics at this moment
    rostest.rosrun("drone_mesh", "three_routers", "__main__.suite")
