#!/usr/bin/env python3
"""Flies a drone to a place through its action, and prints its progress.

While a simulation with actions:=true is running: examples/fly_by_action.py ID X Y [HEIGHT].
Ctrl-C cancels the flight, and the drone stops.
"""

from __future__ import annotations

import argparse
import sys
import time

import actionlib
import rospy
from actionlib_msgs.msg import GoalStatus

from drone_mesh.msg import FlyAction, FlyFeedback, FlyGoal, FlyResult
from drone_mesh.ros.graph.fleet_parameter import drones_if_known

OFFERED_WITHIN_S = 20.0  # wall: a simulation that has just been started needs a few seconds
POLL_PERIOD_S = 0.2  # wall
CONNECTED_WITHIN_S = 60.0  # wall: simulated time may pass many times as fast
CANCELLED_WITHIN_S = 10.0  # simulated


def show(feedback: FlyFeedback) -> None:
    """Print where the drone is."""
    place = f"x {feedback.longitude:.1f}, y {feedback.latitude:.1f}, z {feedback.height:.1f}"
    print(f"{feedback.state}: {place}", flush=True)


def why_not_offered(drone: int) -> str:
    """The reason why the drone does not take orders yet; empty if it does."""
    if drones_if_known() is None:
        return "no simulation is running: roslaunch drone_mesh factory.launch actions:=true"
    if any(
        topic == rospy.resolve_name(f"Drones/{drone}/fly/status")
        for topic, _ in rospy.get_published_topics()
    ):
        return ""
    return f"drone {drone} has no action: start the simulation with actions:=true"


def wait_until_offered(drone: int) -> str:
    """Wait until the drone takes orders and print why it waits; returns why if it never does."""
    deadline_s = time.monotonic() + OFFERED_WITHIN_S
    printed = ""
    while True:
        present = drones_if_known()
        if present is not None and drone not in present.roles:
            return f"there is no drone {drone}: `rosrun drone_mesh status` lists the drones"
        why = why_not_offered(drone)
        if not why or time.monotonic() > deadline_s:
            return why
        if why != printed:
            print(f"{why} (waiting for it, up to {OFFERED_WITHIN_S:.0f} s)", flush=True)
            printed = why
        time.sleep(POLL_PERIOD_S)


def main(drone: int, x: float, y: float, height: int) -> int:
    """Exit code: 0 if the drone has arrived."""
    why = wait_until_offered(drone)
    if why:
        print(why)
        return 1
    client = actionlib.SimpleActionClient(f"Drones/{drone}/fly", FlyAction)
    deadline_s = time.monotonic() + CONNECTED_WITHIN_S
    while not client.wait_for_server(rospy.Duration(POLL_PERIOD_S)):
        if time.monotonic() > deadline_s:
            print(f"the action of drone {drone} does not answer")
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
    print(result.message if isinstance(result, FlyResult) else "the action returned no result")
    return 1


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.partition("\n\n")[0])
    parser.add_argument("id", type=int, help="of the drone")
    parser.add_argument("x", type=float, help="metres")
    parser.add_argument("y", type=float, help="metres")
    parser.add_argument("height", type=int, nargs="?", default=0, help="metres (default: 0)")
    goal = parser.parse_args(rospy.myargv()[1:])
    rospy.init_node("fly_by_action", anonymous=True, disable_signals=True)  # Ctrl-C is ours
    try:
        sys.exit(main(goal.id, goal.x, goal.y, goal.height))
    except KeyboardInterrupt:  # before the drone had an order
        sys.exit(130)
