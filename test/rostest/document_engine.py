#!/usr/bin/env python3
"""Drone engines written from the original design: a goal topic, a position service, DroneInfo.

An engine says where its drone is, at the start and while it moves. A simulator by figure 3.28 reads
the power of the antenna from every message, so it says that it is on.
"""

from __future__ import annotations

import math
from functools import partial

import rospy

from drone_mesh.msg import DroneInfo, Location
from drone_mesh.srv import RequestGPS, RequestGPSResponse

SPEED_M_S = 2.0
PERIOD_S = 0.1
PLACES = {0: (-1.0, 0.0), 1: (0.0, 0.0), 2: (6.0, 0.0), 3: (12.0, 0.0)}  # longitude, latitude
START_S = 10.0  # in which the simulator may register the antennas
CENTRE_M = {0: 0.1, 1: 0.05, 2: 0.05, 3: 0.05}  # of the box, above the ground

now = {drone: (x, y, 0.0) for drone, (x, y) in PLACES.items()}
goals = dict(now)


def take_goal(drone: int, goal: Location) -> None:
    goals[drone] = goal.longitude, goal.latitude, float(goal.height)


def locate(drone: int, _request: object) -> RequestGPSResponse:
    longitude, latitude, height = now[drone]
    return RequestGPSResponse(latitude, longitude, round(height))


def fly(publisher: rospy.Publisher, start_s: float, _event: object) -> None:
    is_start = rospy.get_time() < start_s + START_S
    for drone, goal in goals.items():
        left_m = math.dist(now[drone], goal)
        share = min(1.0, SPEED_M_S * PERIOD_S / left_m) if left_m else 1.0
        now[drone] = tuple(a + (b - a) * share for a, b in zip(now[drone], goal))
        x, y, z = now[drone]
        if left_m or is_start:
            place = x, y, z + CENTRE_M[drone]
            publisher.publish(DroneInfo(nodeID=drone, position=place, on=True))


if __name__ == "__main__":
    rospy.init_node("DocumentEngine")
    announcer = rospy.Publisher("/WirelessSignalSimulator", DroneInfo, queue_size=100)
    for drone in PLACES:
        rospy.Subscriber(f"/Drones/{drone}/goal", Location, partial(take_goal, drone))
        rospy.Service(f"/Drones/{drone}/gps", RequestGPS, partial(locate, drone))
    rospy.Timer(rospy.Duration(PERIOD_S), partial(fly, announcer, rospy.get_time()))
    rospy.spin()
