"""The items in the world's window: drones, ids, lines and text, changed as little as possible."""

from __future__ import annotations

import time
from typing import Sequence, Tuple

import pybullet

from drone_mesh.drone.flight_path import Vector
from drone_mesh.state.model import ObstacleStatus
from drone_mesh.view.bodies import Bodies
from drone_mesh.view.camera import Camera
from drone_mesh.view.palette import LIGHT, Colour, rgb
from drone_mesh.view.scene import DronePicture, Shape

LINE_HEIGHT = 22  # pixels
TEXT_DEPTH_M = 1.0  # distance of the text from the camera
ID_ABOVE = 1.6  # heights of a drone, above its underside
TURNED_AT_ONCE = 8  # our choice, drones per scene: each costs the window as much as two moves
TEXT_SIZE = 1.2  # in units of pybullet
INK = rgb(LIGHT.ink)

Line = Tuple[Vector, Vector, Colour, float]  # start, end, colour, width in pixels
_Item = int  # pybullet's number of a line or text


class WindowItems:
    """The items of one pybullet window. Belongs to the window's thread.

    pybullet renders a frame for each new item, so items are kept or replaced where possible.
    """

    def __init__(self, client: int) -> None:
        self._client = client
        self._shape = Shape.QUADROCOPTER
        self._bodies = Bodies(client, self._shape)
        self._drones: dict[int, tuple[int, DronePicture]] = {}
        self._turned = 0  # drones turned so far, to continue with the next ones
        self._ids: dict[int, _Item] = {}
        self._obstacles: list[tuple[int, ObstacleStatus]] = []
        self._lines: dict[Line, _Item] = {}
        self._texts: list[_Item] = []
        self._written: object = None

    def use_shape(self, shape: Shape) -> None:
        """The shape of all drones shown from now on; call this before the first ones."""
        if shape is not self._shape:
            self._shape, self._bodies = shape, Bodies(self._client, shape)

    def show(
        self, drones: Sequence[DronePicture], lines: set[Line], scale: float, rescaled: bool,
        with_ids: bool,
    ) -> None:  # fmt: skip
        """Show exactly these drones and lines; `rescaled`: `scale` has changed."""
        busy = rescaled or self._looks_changed(drones) or lines != set(self._lines)
        if busy:
            self._render(False)  # otherwise each new item waits for a frame
        self._show_drones(drones, scale, rescaled)
        self._show_ids(scale, with_ids)
        self._show_lines(lines)
        if busy:
            self._render(True)

    def _looks_changed(self, drones: Sequence[DronePicture]) -> bool:
        looks = {drone.node_id: (drone.colour, drone.is_flying) for drone in drones}
        return looks != {
            node_id: (drone.colour, drone.is_flying) for node_id, (_, drone) in self._drones.items()
        }

    def show_obstacles(self, boxes: Sequence[ObstacleStatus]) -> None:
        """Show exactly these boxes."""
        if [box for _, box in self._obstacles] == list(boxes):
            return
        self._render(False)
        for body, _ in self._obstacles:
            pybullet.removeBody(body, physicsClientId=self._client)
        self._obstacles = [(self._bodies.add_obstacle(box), box) for box in boxes]
        self._render(True)

    def write(self, words: Sequence[str], camera: Camera) -> None:
        """Lines of text in the upper left corner, in front of the camera; they move with it."""
        if self._written == (words, camera):
            return
        self._written = (words, camera)
        while len(self._texts) > len(words):
            self._remove(self._texts.pop())
        for row, text in enumerate(words):
            point = camera.before((16, 28 + row * LINE_HEIGHT), TEXT_DEPTH_M)
            replaced = {"replaceItemUniqueId": self._texts[row]} if row < len(self._texts) else {}
            item = pybullet.addUserDebugText(
                text, point, INK, TEXT_SIZE, physicsClientId=self._client, **replaced
            )
            self._texts[row : row + 1] = [item]

    def _render(self, on: bool) -> None:
        pybullet.configureDebugVisualizer(
            pybullet.COV_ENABLE_RENDERING, int(on), physicsClientId=self._client
        )

    def _show_drones(self, drones: Sequence[DronePicture], scale: float, rescaled: bool) -> None:
        shown = {drone.node_id: drone for drone in drones}
        for node_id, (body, before) in list(self._drones.items()):
            now = shown.get(node_id)
            if rescaled or now is None or now.is_flying is not before.is_flying:
                if node_id in self._ids:
                    self._remove(self._ids.pop(node_id))
                pybullet.removeBody(body, physicsClientId=self._client)
                del self._drones[node_id]
        for drone in drones:
            if drone.node_id not in self._drones:
                body = self._bodies.add_drone(drone, scale)
            else:
                body, before = self._drones[drone.node_id]
                if before.centre(scale) != drone.centre(scale):
                    self._bodies.move_drone(body, drone, scale)
                if before.colour != drone.colour:
                    self._bodies.colour_drone(body, drone)
            self._drones[drone.node_id] = (body, drone)
        self._turn_rotors()

    def _turn_rotors(self) -> None:
        """Turn the rotors of the next few drones in flight.

        They stop while simulated time does, because then no new scene arrives.
        """
        flying = [shown for _, shown in sorted(self._drones.items()) if shown[1].is_flying]
        now_s = time.monotonic()
        for number in range(min(TURNED_AT_ONCE, len(flying))):
            body, drone = flying[(self._turned + number) % len(flying)]
            self._bodies.turn_rotors(body, drone, now_s)
        self._turned += TURNED_AT_ONCE

    def _show_ids(self, scale: float, with_ids: bool) -> None:
        for node_id, (body, drone) in self._drones.items():
            if not with_ids:
                if node_id in self._ids:
                    self._remove(self._ids.pop(node_id))
            elif node_id not in self._ids:
                self._ids[node_id] = pybullet.addUserDebugText(
                    str(node_id),
                    (0.0, 0.0, ID_ABOVE * drone.size_m(scale)[2]),
                    INK,
                    TEXT_SIZE,
                    parentObjectUniqueId=body,
                    physicsClientId=self._client,
                )

    def _show_lines(self, lines: set[Line]) -> None:
        spare = [self._lines.pop(line) for line in list(self._lines) if line not in lines]
        for line in lines:
            if line not in self._lines:
                start, end, colour, width = line
                replaced = {"replaceItemUniqueId": spare.pop()} if spare else {}
                self._lines[line] = pybullet.addUserDebugLine(
                    start, end, rgb(colour), width, physicsClientId=self._client, **replaced
                )
        for item in spare:
            self._remove(item)

    def _remove(self, item: _Item) -> None:
        pybullet.removeUserDebugItem(item, physicsClientId=self._client)
