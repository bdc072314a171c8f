"""WorldWindow: shows scenes on a screen, in pybullet's window."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path
from typing import Callable

import pybullet
from PIL import Image, ImageDraw

from drone_mesh.state.links import LinkUse
from drone_mesh.view.palette import GROUND, LIGHT, SHADOW, SKY, rgb
from drone_mesh.view.scene import DRONE_WIDTH_M, Scene, drawing_scale
from drone_mesh.view.window_camera import WindowCamera
from drone_mesh.view.window_items import Line, WindowItems

SIZE = (1280, 800)  # pixels
HELP = (
    "Mouse:  Ctrl + left button turns,  Ctrl + middle button moves,  wheel zooms",
    "Keys:   F all in view    T from above    arrows turn and tilt    + - zoom",
    "        L ids    N known links    H this help    Q close (the simulation continues)",
    "Ground: squares of 2 m",
)
LINK_PIXELS = {LinkUse.KNOWN: 1.0, LinkUse.LOST: 1.0, LinkUse.ROUTE: 3.0}
PATH_PIXELS = 2.0
DRONE_PIXELS = 30  # approximate width of a drone
RESCALE_AT = 1.25  # drones get a new size when theirs is wrong by this factor
TURN_DEG = 2.0  # per check of the keys
ZOOM = 1.03  # per check of the keys
TILE_PIXELS = 256  # of a square of the ground


class WorldWindow:
    """One pybullet window. It only displays; the simulation does not depend on it.

    All functions belong to one thread. Drawing waits for the screen, and pybullet holds the
    interpreter lock meanwhile, so use a separate process. Without a screen pybullet ends the
    process.
    """

    def __init__(self) -> None:
        red, green, blue = rgb(SKY)
        self.client = pybullet.connect(
            pybullet.GUI,
            options=f"--width={SIZE[0]} --height={SIZE[1]} --background_color_red={red} "
            f"--background_color_green={green} --background_color_blue={blue}",
        )
        for feature in (
            pybullet.COV_ENABLE_GUI,
            pybullet.COV_ENABLE_KEYBOARD_SHORTCUTS,  # they conflict with ours
            pybullet.COV_ENABLE_MOUSE_PICKING,
        ):
            pybullet.configureDebugVisualizer(feature, 0, physicsClientId=self.client)
        _lay_ground(self.client)
        self._camera = WindowCamera(self.client, SIZE)
        self._items = WindowItems(self.client)
        self._shows = {"ids": True, "known links": True, "help": True}
        self._scene = Scene()
        self._scale = 1.0
        self._keys: dict[int, Callable[[], None]] = {
            ord("f"): self._camera.follow,
            ord("t"): self._camera.look_from_above,
            ord("l"): lambda: self._toggle("ids"),
            ord("n"): lambda: self._toggle("known links"),
            ord("h"): lambda: self._toggle("help"),
            ord("q"): self.close,
        }
        self._held_keys: dict[int, Callable[[], None]] = {
            pybullet.B3G_LEFT_ARROW: lambda: self._camera.turn(-TURN_DEG, 0.0),
            pybullet.B3G_RIGHT_ARROW: lambda: self._camera.turn(TURN_DEG, 0.0),
            pybullet.B3G_UP_ARROW: lambda: self._camera.turn(0.0, -TURN_DEG),
            pybullet.B3G_DOWN_ARROW: lambda: self._camera.turn(0.0, TURN_DEG),
            ord("+"): lambda: self._camera.zoom(1 / ZOOM),
            ord("="): lambda: self._camera.zoom(1 / ZOOM),  # the same key without shift
            ord("-"): lambda: self._camera.zoom(ZOOM),
        }

    def is_open(self) -> bool:
        """False once it has been closed, here or on the screen."""
        return self.client >= 0 and bool(pybullet.isConnected(physicsClientId=self.client))

    def close(self) -> None:
        """Close the window. A second call changes nothing."""
        if self.is_open():
            pybullet.disconnect(physicsClientId=self.client)
        self.client = -1

    def show(self, scene: Scene) -> None:
        """Display this scene instead of the current one."""
        self._scene = scene
        self._draw()

    def react(self) -> None:
        """Handle keys and mouse; to be called many times a second."""
        if self._camera.take_over():
            self._draw()
        events = pybullet.getKeyboardEvents(physicsClientId=self.client)
        for key, state in events.items():
            if key in self._held_keys and state & pybullet.KEY_IS_DOWN:
                self._held_keys[key]()
            elif key in self._keys and state & pybullet.KEY_WAS_RELEASED:
                # A key pressed and released between two checks is reported only as released.
                self._keys[key]()
            if not self.is_open():
                return
        if events:
            self._draw()

    def _draw(self) -> None:
        self._camera.keep_in_view(self._scene.points())
        wanted = DRONE_PIXELS / self._camera.now.pixels_per_metre() / DRONE_WIDTH_M
        scale = drawing_scale(self._scene.drones, wanted)
        rescaled = not 1 / RESCALE_AT < scale / self._scale < RESCALE_AT
        if rescaled:
            self._scale = scale
        self._items.use_shape(self._scene.shape)
        self._items.show_obstacles(self._scene.obstacles)
        self._items.show(
            self._scene.drones, self._lines(), self._scale, rescaled, self._shows["ids"]
        )
        help_lines = HELP if self._shows["help"] else ("H help",)
        self._items.write((self._scene.title, *help_lines), self._camera.now)

    def _lines(self) -> set[Line]:
        """Links and flight paths."""
        centres = {drone.node_id: drone.centre(self._scale) for drone in self._scene.drones}
        lines = {
            (centres[link.start], centres[link.end], LIGHT.of_link(link.use), LINK_PIXELS[link.use])
            for link in self._scene.links
            if link.start in centres and link.end in centres
            if self._shows["known links"] or link.use is not LinkUse.KNOWN
        }
        for drone in self._scene.drones:
            waypoints = [centres[drone.node_id], *drone.path]
            lines |= {
                (start, end, LIGHT.path, PATH_PIXELS)
                for start, end in zip(waypoints, waypoints[1:])
            }
        return lines

    def _toggle(self, what: str) -> None:
        self._shows[what] = not self._shows[what]


def _lay_ground(client: int) -> None:
    """A plane of tiles, which pybullet draws 2 m wide, for measuring by eye."""
    plane = pybullet.createCollisionShape(pybullet.GEOM_PLANE, physicsClientId=client)
    ground = pybullet.createMultiBody(0.0, plane, physicsClientId=client)
    tile = Image.new("RGB", (TILE_PIXELS, TILE_PIXELS), GROUND)
    last = TILE_PIXELS - 1
    ImageDraw.Draw(tile).rectangle((0, 0, last, last), None, SHADOW, 3)
    with tempfile.TemporaryDirectory() as folder:  # pybullet reads textures only from files
        path = Path(folder) / "tile.png"
        tile.save(path)
        texture = pybullet.loadTexture(os.fspath(path), physicsClientId=client)
    pybullet.changeVisualShape(
        ground,
        -1,
        rgbaColor=(1, 1, 1, 1),
        specularColor=(0, 0, 0),
        textureUniqueId=texture,
        physicsClientId=client,
    )
