"""WorldWindow: shows scenes in pybullet's own window, with ids and links as its debug drawing."""

from __future__ import annotations

import os
from typing import Sequence

import numpy as np
import pybullet
import pybullet_data

from drone_mesh.state.links import LinkUse
from drone_mesh.state.model import ObstacleStatus
from drone_mesh.view.bodies import Bodies
from drone_mesh.view.palette import LIGHT, rgb
from drone_mesh.view.scene import DronePicture, Scene, drawing_scale

SIZE = (1280, 800)  # pixels
LINK_PIXELS = {LinkUse.KNOWN: 1.0, LinkUse.LOST: 1.0, LinkUse.ROUTE: 3.0}
PATH_PIXELS = 2.0
LARGEST = 5.0  # how much drones are enlarged where there is room
ID_ABOVE = 1.6  # heights of a drone, above its underside
TEXT_SIZE = 1.2  # in units of pybullet
INK = rgb(LIGHT.ink)


class WorldWindow:
    """One pybullet window. It only displays; the simulation does not depend on it.

    The mouse turns it (Ctrl + left button), moves it (Ctrl + middle button) and zooms (wheel). All
    functions belong to one thread. pybullet holds the interpreter lock while it waits for the
    screen, so use a separate process. Without a screen pybullet ends the process.
    """

    def __init__(self) -> None:
        options = f"--width={SIZE[0]} --height={SIZE[1]}"
        self.client = pybullet.connect(pybullet.GUI, options=options)
        for feature in (pybullet.COV_ENABLE_GUI, pybullet.COV_ENABLE_SHADOWS):
            pybullet.configureDebugVisualizer(feature, 0, physicsClientId=self.client)
        ground = os.path.join(pybullet_data.getDataPath(), "plane.urdf")
        pybullet.loadURDF(ground, physicsClientId=self.client)
        self._bodies: Bodies | None = None
        self._drones: dict[int, tuple[int, DronePicture]] = {}
        self._obstacles: Sequence[ObstacleStatus] = ()
        self._scale = 1.0
        self._items: list[int] = []  # of the debug drawing, used again for the next scene

    def is_open(self) -> bool:
        """False once it has been closed, here or on the screen."""
        return bool(pybullet.isConnected(physicsClientId=self.client))

    def close(self) -> None:
        """Close the window. A second call changes nothing."""
        if self.is_open():
            pybullet.disconnect(physicsClientId=self.client)

    def show(self, scene: Scene) -> None:
        """Display this scene instead of the current one."""
        if self._bodies is None:
            self._bodies = Bodies(self.client, scene.shape)
        for obstacle in scene.obstacles[len(self._obstacles) :]:  # they stay as long as the world
            self._bodies.add_obstacle(obstacle)
        self._obstacles = scene.obstacles
        if not self._drones and scene.drones:
            self._frame(scene)
        self._render(False)  # otherwise each new item waits for a frame
        self._show_drones(self._bodies, scene.drones)
        spare, self._items = self._items, []
        self._draw_lines(scene, spare)
        for item in spare:
            pybullet.removeUserDebugItem(item, physicsClientId=self.client)
        self._render(True)

    def _frame(self, scene: Scene) -> None:
        """Look at all drones, and choose a size at which they can be told apart."""
        points = np.array(scene.points())
        self._scale = drawing_scale(scene.drones, LARGEST)
        extent_m = float(np.ptp(points, axis=0).max())
        pybullet.resetDebugVisualizerCamera(
            max(5.0, 0.9 * extent_m), 0.0, -50.0, points.mean(axis=0), physicsClientId=self.client
        )

    def _show_drones(self, bodies: Bodies, drones: Sequence[DronePicture]) -> None:
        shown = {drone.node_id: drone for drone in drones}
        for node_id, (body, before) in list(self._drones.items()):
            now = shown.get(node_id)
            if now is None or now.is_flying is not before.is_flying:
                pybullet.removeBody(body, physicsClientId=self.client)  # and its id
                del self._drones[node_id]
        for drone in drones:
            if drone.node_id not in self._drones:
                body = bodies.add_drone(drone, self._scale)
                self._write_id(body, drone)
            else:
                body, before = self._drones[drone.node_id]
                if before.centre(self._scale) != drone.centre(self._scale):
                    bodies.move_drone(body, drone, self._scale)
                if before.colour != drone.colour:
                    bodies.colour_drone(body, drone)
            self._drones[drone.node_id] = (body, drone)

    def _write_id(self, body: int, drone: DronePicture) -> None:
        pybullet.addUserDebugText(
            str(drone.node_id),
            (0.0, 0.0, ID_ABOVE * drone.size_m(self._scale)[2]),
            INK,
            TEXT_SIZE,
            parentObjectUniqueId=body,
            physicsClientId=self.client,
        )

    def _draw_lines(self, scene: Scene, spare: list[int]) -> None:
        centres = {drone.node_id: drone.centre(self._scale) for drone in scene.drones}
        lines = [
            (centres[link.start], centres[link.end], LIGHT.of_link(link.use), LINK_PIXELS[link.use])
            for link in scene.links
            if link.start in centres and link.end in centres
        ]
        for drone in scene.drones:
            waypoints = [centres[drone.node_id], *drone.path]
            lines += [(*ends, LIGHT.path, PATH_PIXELS) for ends in zip(waypoints, waypoints[1:])]
        for start, end, colour, width in lines:
            replaced = {"replaceItemUniqueId": spare.pop()} if spare else {}
            item = pybullet.addUserDebugLine(
                start, end, rgb(colour), width, physicsClientId=self.client, **replaced
            )
            self._items.append(item)

    def _render(self, on: bool) -> None:
        pybullet.configureDebugVisualizer(
            pybullet.COV_ENABLE_RENDERING, int(on), physicsClientId=self.client
        )
