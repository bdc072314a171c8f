#!/usr/bin/env python3
"""A node that flies the drones: for roslaunch drone_mesh factory.launch drones:=external

Give it the same fleet, as parameters. It receives the goals of all drones, moves each straight to
its goal at 2 m/s, answers requests for their positions and reports these. Replace `Drone.step` by
your own simulator or autopilots.
"""

from __future__ import annotations

import math
from functools import partial

import rospy

from drone_mesh import Location, plan_fleet
from drone_mesh.msg import DroneInfo
from drone_mesh.msg import Location as LocationMsg
from drone_mesh.srv import RequestGPS, RequestGPSResponse

SPEED_M_S = 2.0
PERIOD_S = 0.1
CENTRE_M = 0.05  # of a drone's box above its underside


class Drone:
    """One drone: its position and its goal."""

    def __init__(self, place: Location) -> None:
        self.place = self.goal = place

    def step(self, passed_s: float) -> None:
        """Move towards the goal for one step."""
        distance_m = self.place.distance_m(self.goal)
        share = min(1.0, SPEED_M_S * passed_s / distance_m) if distance_m else 1.0
        self.place = Location(*(a + (b - a) * share for a, b in zip(self.place, self.goal)))


class ExternalDrones:
    """Parameters (private): ~gateways (int, 1), ~routers (int, 17), ~gridsize (6), ~spacing (1.0).

    Subscribes /Drones/<id>/goal, offers /Drones/<id>/gps, publishes /WirelessSignalSimulator.
    """

    def __init__(self) -> None:
        fleet = plan_fleet(
            rospy.get_param("~gateways", 1),
            rospy.get_param("~routers", 17),
            rospy.get_param("~gridsize", 6),
            rospy.get_param("~spacing", 1.0),
        )
        self._drones = {at.node_id: Drone(Location(at.latitude, at.longitude, 0.0)) for at in fleet}
        self._publisher = rospy.Publisher("WirelessSignalSimulator", DroneInfo, queue_size=1000)
        for node_id in self._drones:
            topic, service = f"Drones/{node_id}/goal", f"Drones/{node_id}/gps"
            rospy.Subscriber(topic, LocationMsg, partial(self._take_goal, node_id))
            rospy.Service(service, RequestGPS, partial(self._answer, node_id))
        rospy.Timer(rospy.Duration(PERIOD_S), self._step)

    def _take_goal(self, node_id: int, goal: LocationMsg) -> None:
        if all(map(math.isfinite, (goal.latitude, goal.longitude))):
            self._drones[node_id].goal = Location(goal.latitude, goal.longitude, goal.height)

    def _answer(self, node_id: int, _request: object) -> RequestGPSResponse:
        latitude, longitude, height = self._drones[node_id].place
        return RequestGPSResponse(latitude, longitude, round(height))

    def _step(self, _event: object) -> None:
        for node_id, drone in self._drones.items():
            drone.step(PERIOD_S)
            latitude, longitude, height = drone.place
            info = DroneInfo(nodeID=node_id, on=True)
            info.position = [longitude, latitude, height + CENTRE_M]
            self._publisher.publish(info)


if __name__ == "__main__":
    rospy.init_node("external_drones")
    drones = ExternalDrones()
    rospy.spin()
