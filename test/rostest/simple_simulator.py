#!/usr/bin/env python3
"""A WirelessSignalSimulator written from the original design: its figure 3.28 and two services.

An unknown node is registered by a message with a topic; other messages about it are dropped. Each
message about a known node switches its power or else updates all that the message says.
"""

from __future__ import annotations

import math

import rospy

from drone_mesh.msg import NRF24, DroneInfo
from drone_mesh.srv import AreaScan, AreaScanResponse, WirelessMessage, WirelessMessageResponse

RANGE_M = 9.0

positions: dict[int, tuple[float, float, float]] = {}
antennas: dict[int, rospy.Publisher] = {}
powered: dict[int, bool] = {}


def hear(info: DroneInfo) -> None:
    if info.nodeID not in antennas:
        if not info.sub:
            return
        antennas[info.nodeID] = rospy.Publisher(info.sub, NRF24, queue_size=100)
    elif powered[info.nodeID] != info.on:
        powered[info.nodeID] = info.on
        return
    powered[info.nodeID] = info.on
    positions[info.nodeID] = tuple(info.position)


def reaches(sender: int, receiver: int) -> bool:
    if not (powered.get(sender) and powered.get(receiver)):
        return False
    if not {sender, receiver} <= positions.keys():
        return False
    near = math.dist(positions[sender], positions[receiver]) < RANGE_M
    return near and antennas[receiver].get_num_connections() > 0


def carry(request: WirelessMessage) -> WirelessMessageResponse:
    reached = reaches(request.from_, request.to)
    if reached:
        antennas[request.to].publish(request.message)
    return WirelessMessageResponse(reached)


def others(request: AreaScan) -> AreaScanResponse:
    if request.id not in antennas:
        raise rospy.ServiceException(f"node {request.id} is not registered")
    return AreaScanResponse([n for n in antennas if n != request.id and reaches(request.id, n)])


if __name__ == "__main__":
    rospy.init_node("SimpleSimulator")
    rospy.Service("/SignalSimulator/message", WirelessMessage, carry)
    rospy.Service("/SignalSimulator/othersinRange", AreaScan, others)
    rospy.Subscriber("/WirelessSignalSimulator", DroneInfo, hear)
    rospy.spin()
