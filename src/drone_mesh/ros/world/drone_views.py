"""The world's drones in the terms of the mesh state."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Iterable

from drone_mesh.state.observation import DroneView, describe_drone
from drone_mesh.world.factory import VirtualDrone


def drone_views(drones: Iterable[VirtualDrone], now_s: float) -> list[DroneView]:
    """The positions and flight paths of these drones. Any thread."""
    return [_view(drone, now_s) for drone in drones]


def _view(drone: VirtualDrone, now_s: float) -> DroneView:
    engine = drone.engine
    state, pilot, battery = engine.state, engine.pilot, engine.battery_percent()
    return replace(
        describe_drone(drone.node_id, drone.role, state.position, state.path, now_s),
        heading=() if pilot is None or state.path else pilot.heading or (),
        battery=math.nan if battery is None else battery,
        crashed=engine.crashed,
        why_not_fly=engine.why_not_fly(),
    )
