"""Feeds the world's window from a running simulation."""

from __future__ import annotations

import time
from typing import Callable, Sequence

from drone_mesh.ros.world.drone_views import drone_views
from drone_mesh.ros.world.mesh_state import MeshStatePublisher
from drone_mesh.state.links import LostLinks, known_links
from drone_mesh.view.picture import Scene
from drone_mesh.view.scene import scene_of
from drone_mesh.view.window_process import WindowProcess
from drone_mesh.world.drones import VirtualDrone
from drone_mesh.world.interfaces import World


def window_of(
    world: World, drones: Callable[[], Sequence[VirtualDrone]], state: MeshStatePublisher
) -> WindowProcess:
    """A window that is not started yet; it shows current positions and the latest state."""
    lost_links = LostLinks()

    def read_scene() -> Scene:
        mesh = state.latest
        if mesh is None:
            return Scene(title="starting")
        lost = lost_links.update(known_links(mesh.nodes), time.monotonic())
        return scene_of(mesh, lost, drone_views(drones(), world.now_s))

    return WindowProcess(read_scene)
