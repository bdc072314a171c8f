"""Makes repair.gif and patrol.gif in docs/pictures/: the console's page, filmed."""

from __future__ import annotations

import io
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from dataclasses import asdict
from pathlib import Path
from typing import Callable

from PIL import Image, ImageChops
from playwright.sync_api import Page, sync_playwright

from drone_mesh.view.palette import LIGHT

ROOT = Path(__file__).resolve().parents[1]
PICTURES = ROOT / "docs" / "pictures"
MASTER_PORT = "11652"
WIDTH, HEIGHT = 680, 760  # px: the page of a narrow window, where map and story are one column
FRAME_S = 0.4  # wall time between two screenshots
LAST_FRAME_S = 6.0
PATROL_FRAMES = 36
COLOURS = 64  # of the GIF
LIMIT_S = 240.0
CHROMIUM_FLAGS = ["--headless", "--no-sandbox", "--disable-gpu", "--disable-background-networking"]


def take_frame(page: Page) -> Image.Image:
    """The map and the story below it."""
    top = page.locator("#map-card").bounding_box()
    low = page.locator("#story-card").bounding_box() or top
    assert top is not None
    assert low is not None
    clip = {
        "x": top["x"],
        "y": top["y"],
        "width": top["width"],
        "height": low["y"] + low["height"] - top["y"],
    }
    return Image.open(io.BytesIO(page.screenshot(clip=clip))).convert("RGB")


def film(page: Page) -> list[tuple[Image.Image, float]]:
    """The frames of a demonstration, and for how many seconds each one is shown."""
    frames: list[tuple[Image.Image, float]] = []
    began_s = time.monotonic()
    page.wait_for_selector("#story li")
    while page.inner_text("#demonstrate") == "End":
        if time.monotonic() - began_s > LIMIT_S:
            raise SystemExit("timed out: the demonstration does not end")
        frame = take_frame(page)
        if frames and frames[-1][0].size == frame.size:
            seconds = frames[-1][1]
            if ImageChops.difference(frames[-1][0], frame).getbbox() is None:
                frames[-1] = frames[-1][0], seconds + FRAME_S
                continue
        frames.append((frame, FRAME_S))
        page.wait_for_timeout(FRAME_S * 1000)
    page.wait_for_timeout(FRAME_S * 1000)
    return [*frames, (take_frame(page), LAST_FRAME_S)]


def film_patrol(page: Page) -> list[tuple[Image.Image, float]]:
    """Drones on missions, with their trails."""
    page.wait_for_selector("#map-note:has-text('10 drones')")
    page.check("#show-trails")
    page.wait_for_timeout(10_000)  # until trails can be seen
    frames = []
    for _ in range(PATROL_FRAMES):
        frames.append((take_frame(page), FRAME_S))
        page.wait_for_timeout(FRAME_S * 1000)
    return frames


def save(frames: list[tuple[Image.Image, float]], gif: Path) -> None:
    """Write the GIF: all frames in one palette, and padded to the size of the largest."""
    width = max(frame.width for frame, _ in frames)
    height = max(frame.height for frame, _ in frames)
    # The palette's colours cover little of a frame; as large areas, quantize() keeps all of them.
    sheet = frames[0][0].copy()
    for number, colour in enumerate(asdict(LIGHT).values()):
        sheet.paste(colour, (0, 30 * number, sheet.width // 2, 30 * number + 30))
    palette = sheet.quantize(COLOURS)
    pictures = []
    for frame, _seconds in frames:
        whole = Image.new("RGB", (width, height), frame.getpixel((1, frame.height - 12)))
        whole.paste(frame, (0, 0))
        pictures.append(whole.quantize(palette=palette, dither=Image.Dither.NONE))
    pictures[0].save(
        gif,
        save_all=True,
        append_images=pictures[1:],
        duration=[round(1000 * seconds) for _frame, seconds in frames],
        loop=0,
        optimize=True,
    )


def record(
    simulation: list[str],
    console_arguments: list[str],
    film_page: Callable[[Page], list[tuple[Image.Image, float]]],
    gif: Path,
) -> None:
    """Start a simulation and record its console."""
    os.environ["ROS_MASTER_URI"] = f"http://localhost:{MASTER_PORT}"
    command = ["roslaunch", "-p", MASTER_PORT, "drone_mesh", "factory.launch"]
    launch = subprocess.Popen([*command, "seed:=1", *simulation], stdout=sys.stderr)
    console = subprocess.Popen(
        [
            *["roslaunch", "-p", MASTER_PORT, "--wait", "drone_mesh", "console.launch"],
            *["port:=0", *console_arguments],
        ],
        stdout=subprocess.PIPE,
        text=True,
    )
    try:
        assert console.stdout is not None
        url = next(
            match[0] for line in console.stdout if (match := re.search(r"http://127\S+", line))
        )
        with sync_playwright() as playwright:
            browser = playwright.chromium.launch(
                executable_path=shutil.which("chromium"), args=CHROMIUM_FLAGS
            )
            page = browser.new_page(viewport={"width": WIDTH, "height": HEIGHT})
            page.goto(url)
            save(film_page(page), gif)
            browser.close()
    finally:
        for process in (console, launch):
            process.send_signal(signal.SIGINT)
            process.wait(timeout=30)
    print(gif)


def main() -> None:
    """Film a repair and a patrol; with names of pictures as arguments, only those."""
    wanted = sys.argv[1:] or ["repair", "patrol"]
    if "repair" in wanted:
        record(["routers:=5"], ["demo:=repair"], film, PICTURES / "repair.gif")
    if "patrol" in wanted:
        fleet = ["routers:=9", "gridsize:=3", "spacing:=6"]
        missions = f"missions:={ROOT / 'config' / 'patrol.yaml'}"
        record([*fleet, missions], [], film_patrol, PICTURES / "patrol.gif")


if __name__ == "__main__":
    main()
