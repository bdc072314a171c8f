"""The world's drones in the terms of the mesh state."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Iterable, Sequence

from drone_mesh.state.observation import describe_drone
from drone_mesh.state.roster import DroneView
from drone_mesh.world.engine import DroneEngine
from drone_mesh.world.factory import VirtualDrone


def drone_views(drones: Iterable[VirtualDrone], now_s: float) -> list[DroneView]:
    """The positions and flight paths of these drones. Any thread."""
    views = []
    for drone in drones:
        state = drone.engine.state
        engine = drone.engine
        battery = engine.battery_percent()
        view = describe_drone(drone.node_id, drone.role, state.position, state.path, now_s)
        views.append(
            replace(
                view,
                heading=_heading(engine),
                battery=math.nan if battery is None else battery,
                crashed=engine.crashed,
                why_not_fly=engine.why_not_fly(),
            )
        )
    return views


def _heading(engine: DroneEngine) -> Sequence[float]:
    pilot = engine.pilot
    return () if pilot is None or engine.state.path else pilot.heading or ()
