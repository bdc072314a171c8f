"""The legend on the ground in rviz, south of the mesh: one row per colour."""

from __future__ import annotations

import math
from typing import Iterable, NamedTuple

from drone_mesh.drone.flight_path import Vector
from drone_mesh.drone.roles import Role
from drone_mesh.state.condition import Condition
from drone_mesh.state.links import LinkUse
from drone_mesh.view.palette import DARK, Colour

ROUND_TO_M = 5.0  # the legend moves only when the mesh grows or moves by this much
LEAST_HEIGHT_M = 0.5  # of a line of text
LINES_PER_SIDE = 30  # about as many lines as are as high as the mesh
LINE_SPACING = 1.4  # in heights of the text
CHARACTER_WIDTH = 0.5  # in heights of the text
COLUMN_WIDTH = 11.0  # in heights of the text
GAP_M = 1.0  # between mesh and legend


class PlacedLegendRow(NamedTuple):
    """One colour, its meaning, and where to draw them."""

    text: str
    colour: Colour
    thickness: float  # of the swatch, as a share of its width
    height_m: float  # of the text; also the swatch's width
    place: Vector  # the middle of the swatch
    text_place: Vector  # the middle of the text


def legend_rows(positions: Iterable[Vector]) -> list[PlacedLegendRow]:
    """The rows to draw beside drones at these positions, of which there is at least one."""
    xs, ys, _zs = zip(*positions)
    west, east, south, north = (
        ROUND_TO_M * side(value / ROUND_TO_M)
        for side, value in (
            (math.floor, min(xs)),
            (math.ceil, max(xs)),
            (math.floor, min(ys)),
            (math.ceil, max(ys)),
        )
    )
    height_m = max(LEAST_HEIGHT_M, max(east - west, north - south) / LINES_PER_SIDE)
    columns = (_nodes(), _lines())
    middle_m = (west + east - len(columns) * COLUMN_WIDTH * height_m) / 2
    rows = []
    for column, meanings in enumerate(columns):
        x = middle_m + column * COLUMN_WIDTH * height_m
        for number, (text, colour, thickness) in enumerate(meanings, start=1):
            y = south - GAP_M - number * LINE_SPACING * height_m
            text_x = x + height_m * (1 + len(text) * CHARACTER_WIDTH / 2)
            rows.append(
                PlacedLegendRow(text, colour, thickness, height_m, (x, y, 0), (text_x, y, 0))
            )
    return rows


def _nodes() -> list[tuple[str, Colour, float]]:
    return [
        ("gateway", DARK.of_node(Role.GATEWAY, Condition.CONNECTED), 0.8),
        *((one.value, DARK.of_node(Role.ROUTER, one), 0.8) for one in Condition),
        ("obstacle", DARK.obstacle, 0.8),
    ]


def _lines() -> list[tuple[str, Colour, float]]:
    links = [(use.value, DARK.of_link(use), 0.25) for use in LinkUse]
    return [
        *links,
        ("link that will soon break", DARK.flying, 0.25),
        ("flight path", DARK.path, 0.25),
        ("heading", DARK.muted, 0.25),
        ("stay inside", DARK.accent, 0.25),
        ("stay out", DARK.disconnected, 0.25),
    ]
