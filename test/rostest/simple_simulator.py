#!/usr/bin/env python3
"""A WirelessSignalSimulator of the specification: `message` and `othersinRange` alone."""

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
    if not info.sub:
        positions[info.nodeID] = tuple(info.position)
        return
    if info.nodeID not in antennas:
        antennas[info.nodeID] = rospy.Publisher(info.sub, NRF24, queue_size=100)
    powered[info.nodeID] = info.on


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
