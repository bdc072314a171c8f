#!/usr/bin/env python3
"""Flies a drone to a place through its action, and prints its progress.

While a simulation with actions:=true is running: examples/fly_by_action.py ID X Y [HEIGHT].
Ctrl-C cancels the flight, and the drone stops.
"""

from __future__ import annotations

import sys

import actionlib
import rospy
from actionlib_msgs.msg import GoalStatus

from drone_mesh.msg import FlyAction, FlyFeedback, FlyGoal, FlyResult

SERVER_WITHIN_S = 20.0  # simulated
CANCELLED_WITHIN_S = 10.0  # simulated


def show(feedback: FlyFeedback) -> None:
    """Print where the drone is."""
    place = f"x {feedback.longitude:.1f}, y {feedback.latitude:.1f}, z {feedback.height:.1f}"
    print(f"{feedback.state}: {place}, {feedback.distance:.1f} m left", flush=True)


def main(drone: int, x: float, y: float, height: int) -> int:
    """Exit code: 0 if the drone has arrived."""
    client = actionlib.SimpleActionClient(f"/Drones/{drone}/fly", FlyAction)
    if not client.wait_for_server(rospy.Duration(SERVER_WITHIN_S)):
        print(f"drone {drone} has no action: start the simulation with actions:=true")
        return 1
    client.send_goal(FlyGoal(latitude=y, longitude=x, height=height), feedback_cb=show)
    try:
        client.wait_for_result()
    except KeyboardInterrupt:
        client.cancel_goal()
        client.wait_for_result(rospy.Duration(CANCELLED_WITHIN_S))
    result = client.get_result()
    if client.get_state() == GoalStatus.SUCCEEDED:
        print("arrived")
        return 0
    print(result.message if isinstance(result, FlyResult) else "no result came")
    return 1


if __name__ == "__main__":
    words = rospy.myargv()[1:]
    if len(words) not in (3, 4):
        sys.exit(__doc__)
    rospy.init_node("fly_by_action", anonymous=True, disable_signals=True)  # Ctrl-C is ours
    numbers = [float(word) for word in words]
    try:
        sys.exit(main(int(numbers[0]), numbers[1], numbers[2], int((numbers[3:] or [0])[0])))
    except KeyboardInterrupt:  # before the drone had an order
        sys.exit(130)
