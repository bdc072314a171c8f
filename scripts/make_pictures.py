"""Takes the pictures of docs/pictures while layout 202 repairs the loss of router 2."""

from __future__ import annotations

import contextlib
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Callable, Iterator

import rospy
from PIL import ImageGrab
from playwright.sync_api import Browser, sync_playwright

from drone_mesh.msg import MeshState
from drone_mesh.ros.views.console_controls import RosControls

PICTURES = Path(__file__).resolve().parents[1] / "docs" / "pictures"
MASTER_PORT = "11651"
CONSOLE_PORT = "18651"
SCREEN = ":95"
SCREEN_SIZE = (1400, 900)
CASE, LOST_ROUTER = 202, 2
ROUTERS = 5
ROUNDS_S = 25.0  # simulated; by then each node has asked where the next hop is
FAST = 4.0  # real-time factor while no picture is taken
LIMIT_S = 240.0  # wall time for each wait
FEWEST_COLOURS = 300  # of a drawn screen; an empty one has a handful
SETTLE_S = 3.0  # wall time for drawing a screen
CHROMIUM_FLAGS = ["--headless", "--no-sandbox", "--disable-gpu", "--disable-background-networking"]


class Watch:
    """The newest state of the mesh."""

    def __init__(self) -> None:
        self.state: MeshState | None = None
        rospy.Subscriber("/mesh/state", MeshState, self._on_state)

    def _on_state(self, state: MeshState) -> None:
        self.state = state

    @property
    def time_s(self) -> float:
        """Simulated time."""
        return 0.0 if self.state is None else self.state.header.stamp.to_sec()

    def wait_for(self, what: str, condition: Callable[[MeshState], bool]) -> None:
        print(f"waiting: {what}", flush=True)
        deadline_s = time.monotonic() + LIMIT_S
        while self.state is None or not condition(self.state):
            if time.monotonic() > deadline_s:
                raise SystemExit(f"timed out: {what}")
            time.sleep(0.02)


@contextlib.contextmanager
def running(*command: str) -> Iterator[subprocess.Popen[bytes]]:
    """A process with its output on stderr, ended by Ctrl-C."""
    process = subprocess.Popen(command, stdout=sys.stderr)
    try:
        yield process
    finally:
        process.send_signal(signal.SIGINT)
        process.wait(timeout=30)


def all_stand_connected(state: MeshState) -> bool:
    return len(state.nodes) == ROUTERS + 1 and all(
        node.connected and not len(node.path) for node in state.nodes if node.on
    )


def is_flown(state: MeshState) -> bool:
    """Whether the layout is: its drones set out one after another."""
    done = f"layout {CASE}: {ROUTERS} of {ROUTERS} at their places"
    return done in state.layouts and all_stand_connected(state)


def a_drone_flies(state: MeshState) -> bool:
    return any(len(node.path) for node in state.nodes)


def take_page(browser: Browser, url: str, name: str, whole: bool, *selectors: str) -> None:
    page = browser.new_page(viewport={"width": 1400, "height": 880})
    page.goto(url)
    page.wait_for_timeout(SETTLE_S * 1000)
    for selector in selectors:
        page.click(selector)
    page.wait_for_timeout(500)
    page.screenshot(path=str(PICTURES / name), full_page=whole)
    page.close()


def take_screen(name: str) -> None:
    """Save the screen as soon as something is drawn on it; rviz takes seconds to start."""
    deadline_s = time.monotonic() + LIMIT_S
    while True:
        picture = ImageGrab.grab(xdisplay=SCREEN)
        if picture.getcolors(FEWEST_COLOURS) is None:
            picture.save(PICTURES / name)
            return
        if time.monotonic() > deadline_s:
            raise SystemExit(f"timed out: nothing on the screen for {name}")
        time.sleep(0.5)


def take_pictures(browser: Browser, folder: Path) -> None:
    controls, watch = RosControls(), Watch()
    watch.wait_for("all connected", all_stand_connected)
    with running("roslaunch", "drone_mesh", "record.launch", f"bag:={folder}/run"):
        watch.wait_for("the recorder", lambda _state: any(folder.glob("*.active")))
        controls.speed(False, FAST)
        controls.layout(CASE)
        watch.wait_for("the drones take off", a_drone_flies)
        watch.wait_for("all connected in their places", is_flown)
        settled_until_s = watch.time_s + ROUNDS_S
        watch.wait_for("some check periods", lambda _state: watch.time_s >= settled_until_s)
        controls.power(LOST_ROUTER, False)
        watch.wait_for("the repair's drone takes off", a_drone_flies)
        controls.speed(True, 0.0)
        time.sleep(SETTLE_S)
        take_screen("rviz.png")
        console = f"http://127.0.0.1:{CONSOLE_PORT}/"
        take_page(browser, console, "console.png", False, "#nodes tr[data-condition=flying]")
        subprocess.run(["rosrun", "drone_mesh", "snapshot", PICTURES / "world.png"], check=True)
        controls.speed(False, FAST)
        watch.wait_for("all connected again", all_stand_connected)
        time.sleep(SETTLE_S)
    (bag,) = folder.glob("*.bag")
    page = folder / "report.html"
    title = f"Layout {CASE}, router {LOST_ROUTER} off"
    command = ["rosrun", "drone_mesh", "report", bag, "-o", page, "--title", title]
    subprocess.run(command, check=True)
    take_page(browser, page.as_uri(), "report.png", True)


def main() -> None:
    os.environ.update(
        ROS_MASTER_URI=f"http://localhost:{MASTER_PORT}", DISPLAY=SCREEN, LIBGL_ALWAYS_SOFTWARE="1"
    )
    PICTURES.mkdir(parents=True, exist_ok=True)
    width, height = SCREEN_SIZE
    factory = ["factory.launch", f"routers:={ROUTERS}", "seed:=1"]
    console = ["console.launch", f"port:={CONSOLE_PORT}"]
    launch = ["roslaunch", "-p", MASTER_PORT, "drone_mesh"]
    with contextlib.ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        screen = f"-screen 0 {width}x{height}x24 -nolisten tcp -noreset"
        stack.enter_context(running("Xvfb", SCREEN, *screen.split()))
        stack.enter_context(running(*launch, *factory))
        stack.enter_context(running(*launch, "--wait", *console))
        stack.enter_context(running(*launch, "--wait", "rviz.launch"))
        while subprocess.run(["rosparam", "get", "/use_sim_time"], capture_output=True).returncode:
            time.sleep(0.5)
        rospy.init_node("make_pictures", anonymous=True, disable_signals=True)
        playwright = stack.enter_context(sync_playwright())
        browser = playwright.chromium.launch(
            executable_path=shutil.which("chromium"), args=CHROMIUM_FLAGS
        )
        stack.callback(browser.close)
        take_pictures(browser, folder)
    print("\n".join(map(str, sorted(PICTURES.glob("*.png")))))


if __name__ == "__main__":
    main()
