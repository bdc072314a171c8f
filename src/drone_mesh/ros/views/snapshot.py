"""rosrun drone_mesh snapshot: a picture of the world, without a screen."""

from __future__ import annotations

import argparse
import re
from pathlib import Path

from drone_mesh.errors import MeshError
from drone_mesh.ros.graph.command_line import run_tool
from drone_mesh.ros.views.state_source import chosen_state, parse_with_bag
from drone_mesh.view.scene import scene_of
from drone_mesh.world.physics import require_pybullet

DEFAULT_SIZE = (1280, 800)  # pixels
SMALLEST, LARGEST = 200, 8000  # pixels


def main() -> None:
    parser = argparse.ArgumentParser(
        prog="rosrun drone_mesh snapshot",
        description="Writes a picture of drones, links and flights. Needs no screen.",
        epilog="Exit code: 0 written, 2 failed.",
    )
    parser.add_argument("picture", type=_png, help="the PNG file to write")
    parser.add_argument(
        "--size",
        type=_size,
        default=DEFAULT_SIZE,
        metavar="WxH",
        help=f"size in pixels (default: {DEFAULT_SIZE[0]}x{DEFAULT_SIZE[1]})",
    )
    options = parse_with_bag(parser)
    run_tool("snapshot", lambda: _run(options))


def _png(text: str) -> Path:
    path = Path(text)
    if path.suffix.lower() != ".png":
        raise argparse.ArgumentTypeError(f"{text!r}: must end in .png, the only format written")
    return path


def _size(text: str) -> tuple[int, int]:
    match = re.fullmatch(r"([0-9]{1,9})x([0-9]{1,9})", text)
    size = (int(match[1]), int(match[2])) if match else (0, 0)
    if not all(SMALLEST <= pixels <= LARGEST for pixels in size):
        raise argparse.ArgumentTypeError(
            f"invalid size {text!r}: must be WIDTHxHEIGHT, each {SMALLEST}..{LARGEST} pixels"
        )
    return size


def _run(options: argparse.Namespace) -> int:
    require_pybullet("snapshot")
    from drone_mesh.view.snapshot import render

    with chosen_state(options, "mesh_snapshot") as mesh:
        try:
            render(scene_of(mesh), options.picture, options.size)
        except (OSError, ValueError) as error:
            raise MeshError(f"{options.picture}: {error}") from error
        print(options.picture)
    return 0
