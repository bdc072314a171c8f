"""The goals that a drone accepts (docs/ros.md, "Goals"); checked wherever orders pass."""

from __future__ import annotations

import itertools
import math
from typing import Mapping

from drone_mesh.drone.fence import Fence
from drone_mesh.drone.location import Location
from drone_mesh.errors import GoalRefused

MAX_COORDINATE_M = 5000.0  # latitude and longitude: -5000..5000 m
MAX_HEIGHT_M = 500.0  # height of the underside: 0..500 m
ROUNDING_M = 0.01  # places travel as float32 and in steps


def check_goal(
    latitude: float,
    longitude: float,
    height: float,
    fence: Fence = Fence(),  # noqa: B008 (frozen)
) -> None:
    """Raise GoalRefused unless a drone may fly to this position (metres, world frame)."""
    bounds = (
        ("latitude", latitude, -MAX_COORDINATE_M, MAX_COORDINATE_M),
        ("longitude", longitude, -MAX_COORDINATE_M, MAX_COORDINATE_M),
        ("height", height, 0.0, MAX_HEIGHT_M),
    )
    for name, value, lowest, highest in bounds:
        if not math.isfinite(value):
            raise GoalRefused(f"{name} {value} is not a finite number of metres")
        if not lowest <= value <= highest:
            raise GoalRefused(f"{name} {value:g} m is outside {lowest:g}..{highest:g} m")
    why_not = fence.why_not((longitude, latitude, height)) if fence.rules else ""
    if why_not:
        raise GoalRefused(why_not)


def check_apart(goals: Mapping[int, Location], clearance_m: float) -> None:
    """Raise GoalRefused if two of these drones would stand nearer to each other than that."""
    for (one, goal), (other, place) in itertools.combinations(sorted(goals.items()), 2):
        away_m = goal.distance_m(place)
        if away_m < clearance_m - ROUNDING_M:
            raise GoalRefused(
                f"drones {one} and {other} would stand {away_m:.2f} m apart: "
                f"the clearance is {clearance_m:g} m"
            )
