#!/usr/bin/env python3
"""What shows the mesh beside the log: markers for rviz, and the web console, in one launch."""

from __future__ import annotations

import unittest

import rospy
import rostest
from rostest_support import in_order, rest_between_ticks
from test_mesh_console import MeshConsoleTest
from test_mesh_markers import MeshMarkersTest


def suite() -> unittest.TestSuite:
    return in_order(MeshMarkersTest, MeshConsoleTest)


if __name__ == "__main__":
    rospy.init_node("test_views")
    rest_between_ticks()
    rostest.rosrun("drone_mesh", "views", "__main__.suite")
