"""WorldWindow: shows scenes on a screen, in pybullet's own window."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Callable, Tuple

import pybullet

from drone_mesh.drone.flight_path import Vector
from drone_mesh.view.camera import Camera, Margins, frame
from drone_mesh.view.ground import lay_ground
from drone_mesh.view.picture import (
    DRONE_WIDTH_M,
    LINK_COLOURS,
    PATH_COLOUR,
    DronePicture,
    LinkUse,
    Scene,
    drawing_scale,
)
from drone_mesh.world.interfaces import Colour

SIZE = (1280, 800)  # pixels
MARGINS = Margins(left=90, top=130, right=90, bottom=60)  # pixels
HELP = (
    "Mouse:  Ctrl + left button turns,  Ctrl + middle button moves,  wheel zooms",
    "Keys:   F all in view    T from above    arrows turn and tilt    + - zoom",
    "        L ids    N neighbours    H this help    Q close (the simulation goes on)",
    "Ground: squares of 2 m",
)
SKY: Colour = (0.85, 0.90, 0.95, 1.0)
INK: Colour = (0.09, 0.12, 0.16, 1.0)
DRONE_PIXELS = 20  # about as wide as a drone should be
RESCALE_AT = 1.25  # drones get a new size when theirs is wrong by this factor
LINE_HEIGHT = 22  # pixels
TEXT_DEPTH_M = 1.0  # text hangs so far before the camera
TEXT_SIZE = 1.2  # in units of pybullet
TURN_DEG = 2.0  # per look at the keys
ZOOM = 1.03  # per look at the keys
STEEPEST_DEG, FLATTEST_DEG = -89.0, -5.0
FROM_ABOVE_DEG, SLANTED_DEG = STEEPEST_DEG, -60.0

_Item = int  # pybullet's number of a line or text
_Line = Tuple[Vector, Vector, Colour, float]  # start, end, colour, width in pixels


class WorldWindow:
    """One window of pybullet; it only shows, and holds nothing that the simulation needs.

    All functions belong to one thread. Drawing waits for the screen: use a process of its own,
    since pybullet holds the interpreter meanwhile. Without a screen pybullet ends the process.
    """

    def __init__(self) -> None:
        red, green, blue, _ = SKY
        self.client = pybullet.connect(
            pybullet.GUI,
            options=f"--width={SIZE[0]} --height={SIZE[1]} --background_color_red={red} "
            f"--background_color_green={green} --background_color_blue={blue}",
        )
        for feature in (
            pybullet.COV_ENABLE_GUI,
            pybullet.COV_ENABLE_KEYBOARD_SHORTCUTS,  # ours would mean something else there
            pybullet.COV_ENABLE_MOUSE_PICKING,
        ):
            pybullet.configureDebugVisualizer(feature, 0, physicsClientId=self.client)
        lay_ground(self.client)
        self._camera = Camera(SIZE, pitch_deg=SLANTED_DEG)
        self._follows = True  # the fleet, until somebody moves the camera
        self._shows = {"labels": True, "neighbours": True, "help": True}
        self._scene = Scene()
        self._scale = 1.0
        self._boxes: dict[int, tuple[int, DronePicture]] = {}
        self._labels: dict[int, _Item] = {}
        self._lines: dict[_Line, _Item] = {}
        self._texts: list[_Item] = []
        self._written: object = None
        self._keys: dict[int, Callable[[], None]] = {
            ord("f"): self._follow,
            ord("t"): self._look_from_above,
            ord("l"): lambda: self._toggle("labels"),
            ord("n"): lambda: self._toggle("neighbours"),
            ord("h"): lambda: self._toggle("help"),
            ord("q"): self.close,
        }
        self._held_keys: dict[int, Callable[[], None]] = {
            pybullet.B3G_LEFT_ARROW: lambda: self._turn(-TURN_DEG, 0.0),
            pybullet.B3G_RIGHT_ARROW: lambda: self._turn(TURN_DEG, 0.0),
            pybullet.B3G_UP_ARROW: lambda: self._turn(0.0, -TURN_DEG),
            pybullet.B3G_DOWN_ARROW: lambda: self._turn(0.0, TURN_DEG),
            ord("+"): lambda: self._zoom(1 / ZOOM),
            ord("="): lambda: self._zoom(1 / ZOOM),  # the same key without shift
            ord("-"): lambda: self._zoom(ZOOM),
        }

    def is_open(self) -> bool:
        """False once somebody has closed it."""
        return self.client >= 0 and bool(pybullet.isConnected(physicsClientId=self.client))

    def close(self) -> None:
        """Closing twice changes nothing."""
        if self.is_open():
            pybullet.disconnect(physicsClientId=self.client)
        self.client = -1

    def show(self, scene: Scene) -> None:
        """Replace what is to be seen."""
        self._scene = scene
        self._draw()

    def react(self) -> None:
        """Do what keys and mouse ask for; to be called many times a second."""
        self._follow_mouse()
        events = pybullet.getKeyboardEvents(physicsClientId=self.client)
        for key, state in events.items():
            if key in self._held_keys and state & pybullet.KEY_IS_DOWN:
                self._held_keys[key]()
            elif key in self._keys and state & pybullet.KEY_WAS_RELEASED:
                # Pressed and released between two looks, a key shows only that it was released.
                self._keys[key]()
            if not self.is_open():
                return
        if events:
            self._draw()

    def _draw(self) -> None:
        if self._follows:
            self._aim(frame(self._camera, self._scene.points(), MARGINS))
        wanted = DRONE_PIXELS / self._camera.pixels_per_metre() / DRONE_WIDTH_M
        scale = drawing_scale(self._scene.drones, wanted)
        rescaled = not 1 / RESCALE_AT < scale / self._scale < RESCALE_AT
        if rescaled:
            self._scale = scale
        lines = self._wanted_lines()
        ids = {drone.node_id for drone in self._scene.drones}
        # Each new item waits for a frame, unless the screen holds still meanwhile.
        busy = rescaled or ids != set(self._boxes) or lines != set(self._lines)
        if busy:
            self._hold_still(True)
        self._draw_drones(rescaled)
        self._draw_labels()
        self._draw_lines(lines)
        if busy:
            self._hold_still(False)
        self._write()

    def _hold_still(self, still: bool) -> None:
        pybullet.configureDebugVisualizer(
            pybullet.COV_ENABLE_RENDERING, int(not still), physicsClientId=self.client
        )

    def _draw_drones(self, again: bool) -> None:
        ids = {drone.node_id for drone in self._scene.drones}
        for node_id in [n for n in self._boxes if again or n not in ids]:
            if node_id in self._labels:
                self._remove(self._labels.pop(node_id))
            pybullet.removeBody(self._boxes.pop(node_id)[0], physicsClientId=self.client)
        for drone in self._scene.drones:
            if drone.node_id not in self._boxes:
                self._boxes[drone.node_id] = (self._new_box(drone), drone)
                continue
            box, shown = self._boxes[drone.node_id]
            if shown.position != drone.position:
                pybullet.resetBasePositionAndOrientation(
                    box, drone.centre(self._scale), (0, 0, 0, 1), physicsClientId=self.client
                )
            if shown.colour != drone.colour:
                pybullet.changeVisualShape(
                    box, -1, rgbaColor=drone.colour, physicsClientId=self.client
                )
            self._boxes[drone.node_id] = (box, drone)

    def _new_box(self, drone: DronePicture) -> int:
        shape = pybullet.createVisualShape(
            pybullet.GEOM_BOX,
            halfExtents=[edge_m / 2 for edge_m in drone.size_m(self._scale)],
            rgbaColor=drone.colour,
            specularColor=(0, 0, 0),
            physicsClientId=self.client,
        )
        return int(
            pybullet.createMultiBody(
                0.0, -1, shape, drone.centre(self._scale), physicsClientId=self.client
            )
        )

    def _draw_labels(self) -> None:
        for node_id, (box, drone) in self._boxes.items():
            if not self._shows["labels"]:
                if node_id in self._labels:
                    self._remove(self._labels.pop(node_id))
            elif node_id not in self._labels:
                above_m = drone.size_m(self._scale)[2]
                self._labels[node_id] = pybullet.addUserDebugText(
                    str(node_id),
                    (0.0, 0.0, above_m),
                    INK[:3],
                    TEXT_SIZE,
                    parentObjectUniqueId=box,
                    physicsClientId=self.client,
                )

    def _wanted_lines(self) -> set[_Line]:
        """Links and flights."""
        centres = {drone.node_id: drone.centre(self._scale) for drone in self._scene.drones}
        widths = {LinkUse.KNOWN: 1.0, LinkUse.LOST: 1.0, LinkUse.ROUTE: 3.0}
        lines = [
            (centres[link.start], centres[link.end], LINK_COLOURS[link.use], widths[link.use])
            for link in self._scene.links
            if link.start in centres and link.end in centres
            if self._shows["neighbours"] or link.use is not LinkUse.KNOWN
        ]
        for drone in self._scene.drones:
            corners = [centres[drone.node_id], *drone.path]
            lines += [(start, end, PATH_COLOUR, 2.0) for start, end in zip(corners, corners[1:])]
        return set(lines)

    def _draw_lines(self, wanted: set[_Line]) -> None:
        spare = [self._lines.pop(line) for line in list(self._lines) if line not in wanted]
        for line in wanted:
            if line not in self._lines:
                start, end, colour, width = line
                replaced = {"replaceItemUniqueId": spare.pop()} if spare else {}
                self._lines[line] = pybullet.addUserDebugLine(
                    start, end, colour[:3], width, physicsClientId=self.client, **replaced
                )
        for item in spare:
            self._remove(item)

    def _write(self) -> None:
        """The title and the help, which hang before the camera and go with it."""
        words = (self._scene.title, *(HELP if self._shows["help"] else ("H help",)))
        if self._written == (words, self._camera):
            return
        self._written = (words, self._camera)
        while len(self._texts) > len(words):
            self._remove(self._texts.pop())
        for row, text in enumerate(words):
            place = self._camera.before((16, 28 + row * LINE_HEIGHT), TEXT_DEPTH_M)
            replaced = {"replaceItemUniqueId": self._texts[row]} if row < len(self._texts) else {}
            item = pybullet.addUserDebugText(
                text, place, INK[:3], TEXT_SIZE, physicsClientId=self.client, **replaced
            )
            self._texts[row : row + 1] = [item]

    def _remove(self, item: _Item) -> None:
        pybullet.removeUserDebugItem(item, physicsClientId=self.client)

    def _aim(self, camera: Camera) -> None:
        if camera != self._camera:
            self._camera = camera
            pybullet.resetDebugVisualizerCamera(
                camera.distance_m,
                camera.yaw_deg,
                camera.pitch_deg,
                camera.target,
                physicsClientId=self.client,
            )

    def _follow_mouse(self) -> None:
        """Learn where somebody has moved the camera with the mouse."""
        seen = pybullet.getDebugVisualizerCamera(physicsClientId=self.client)
        (width, height), projection = seen[:2], seen[3]
        yaw_deg, pitch_deg, distance_m, target = seen[8:12]
        if not (width and height and projection[5]):
            return
        camera = Camera(
            (width, height),
            target,
            distance_m,
            yaw_deg,
            pitch_deg,
            math.degrees(2 * math.atan(1 / projection[5])),
        )
        moved = not _looks_alike(camera, self._camera)
        if moved or (camera.size, camera.field_of_view_deg) != (
            self._camera.size,
            self._camera.field_of_view_deg,
        ):
            self._follows = self._follows and not moved
            self._camera = camera
            self._draw()

    def _follow(self) -> None:
        self._follows = True

    def _look_from_above(self) -> None:
        steep = self._camera.pitch_deg <= FROM_ABOVE_DEG
        self._aim(replace(self._camera, pitch_deg=SLANTED_DEG if steep else FROM_ABOVE_DEG))
        self._follows = True

    def _turn(self, yaw_deg: float, pitch_deg: float) -> None:
        pitch = self._camera.pitch_deg + pitch_deg
        self._aim(
            replace(
                self._camera,
                yaw_deg=self._camera.yaw_deg + yaw_deg,
                pitch_deg=max(STEEPEST_DEG, min(FLATTEST_DEG, pitch)),
            )
        )

    def _zoom(self, factor: float) -> None:
        self._follows = False
        self._aim(replace(self._camera, distance_m=self._camera.distance_m * factor))

    def _toggle(self, what: str) -> None:
        self._shows[what] = not self._shows[what]


def _looks_alike(camera: Camera, other: Camera) -> bool:
    """Whether two cameras look from the same place, as far as pybullet's single precision tells."""
    return all(
        math.isclose(a, b, rel_tol=1e-3, abs_tol=1e-2)
        for a, b in zip(
            (*camera.target, camera.distance_m, camera.yaw_deg, camera.pitch_deg),
            (*other.target, other.distance_m, other.yaw_deg, other.pitch_deg),
        )
    )
