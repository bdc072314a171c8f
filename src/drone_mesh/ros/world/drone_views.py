"""The drones of the world in the terms of the mesh's state."""

from __future__ import annotations

from typing import Iterable

from drone_mesh.state.observation import describe_drone
from drone_mesh.state.roster import DroneView
from drone_mesh.world.drones import VirtualDrone


def drone_views(drones: Iterable[VirtualDrone], now_s: float) -> list[DroneView]:
    """Where these drones are and where they fly. May be called in any thread."""
    views = []
    for drone in drones:
        state = drone.engine.state
        views.append(describe_drone(drone.node_id, drone.ROLE, state.position, state.path, now_s))
    return views
