#!/usr/bin/env python3
"""Orders a drone to a place and follows the order until the drone has arrived.

While a simulation is running: examples/fly_and_follow.py ID X Y [HEIGHT]
"""

from __future__ import annotations

import sys
import threading

import rospy

from drone_mesh.msg import MeshEvent
from drone_mesh.srv import RequestDroneFlight

LIMIT_S = 120.0  # wall
WORDS = {
    MeshEvent.ORDER_SENT: "the gateway has sent the order",
    MeshEvent.ORDER_ACCEPTED: "the drone has accepted it",
    MeshEvent.ORDER_REFUSED: "the drone has refused it",
    MeshEvent.ORDER_ARRIVED: "the drone has arrived",
    MeshEvent.ORDER_GIVEN_UP: "no answer came: given up",
}
LAST = (MeshEvent.ORDER_REFUSED, MeshEvent.ORDER_ARRIVED, MeshEvent.ORDER_GIVEN_UP)


def main(drone: int, x: float, y: float, height: int) -> int:
    """Exit code: 0 if the drone has arrived."""
    over = threading.Event()
    outcome = [MeshEvent.ORDER_GIVEN_UP]

    def on_event(event: MeshEvent) -> None:
        if event.code in WORDS and drone in event.peers:
            print(f"{event.stamp.to_sec():.1f} s: {WORDS[event.code]}", flush=True)
            outcome[0] = event.code
            if event.code in LAST:
                over.set()

    events = rospy.Subscriber("mesh/events", MeshEvent, on_event)
    while not events.get_num_connections():
        rospy.rostime.wallsleep(0.05)
    order = rospy.ServiceProxy("DroneManager/requestDroneMovement", RequestDroneFlight)
    status = order(ID=drone, latitude=y, longitude=x, height=height).status
    if status != 1:
        print("no gateway is running" if status == 0 else f"no gateway has a route to {drone}")
        return 1
    if not over.wait(LIMIT_S):
        print(f"the order had no outcome within {LIMIT_S:.0f} s")
    return 0 if outcome[0] == MeshEvent.ORDER_ARRIVED else 1


if __name__ == "__main__":
    words = rospy.myargv()[1:]
    if len(words) not in (3, 4):
        sys.exit(__doc__)
    rospy.init_node("fly_and_follow", anonymous=True)
    numbers = [float(word) for word in words]
    sys.exit(main(int(numbers[0]), numbers[1], numbers[2], int((numbers[3:] or [0])[0])))
