"""How the drones of the running simulation fly, for those who plan flights."""

from __future__ import annotations

import functools

from drone_mesh.drone.flight_path import FlightPath, PlanFlight
from drone_mesh.errors import ConfigurationError
from drone_mesh.ros.graph.fleet_parameter import get_fleet_parameter
from drone_mesh.ros.graph.master_watch import NO_ANSWER
from drone_mesh.ros.graph.parameters import configured_obstacles
from drone_mesh.state.airspace import SWAY_M
from drone_mesh.state.departures import FlightRules


def flight_rules() -> FlightRules:
    """The rules of the present factory; those of kinematic drones if there is none."""
    try:
        fleet = get_fleet_parameter()
        obstacles = configured_obstacles(fleet)
    except (KeyError, ConfigurationError, *NO_ANSWER):
        return FlightRules()
    plan: PlanFlight = functools.partial(FlightPath, ceiling_m=fleet.cruise_height)
    if obstacles is not None:
        plan = obstacles.plan_flight
    return FlightRules(plan, SWAY_M if fleet.flight == "dynamic" else 0.0)
