"""One palette for all views: legible, and no colour is typed anywhere else."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import drone_mesh
from drone_mesh.drone.roles import Role
from drone_mesh.state.condition import Condition
from drone_mesh.state.links import LinkUse
from drone_mesh.view.palette import DARK, LIGHT, Palette, css_variables, rgb

PACKAGE = Path(drone_mesh.__file__).parent
TEXT_COLOURS = (
    "gateway", "connected", "flying", "disconnected", "off", "silent", "crashed", "ink", "muted",
    "accent",
)  # fmt: skip
COLOUR = r"(?<=[\"': ])#(?:[0-9a-fA-F]{6}|[0-9a-fA-F]{3})(?![-\w(])"
ENOUGH = 4.5  # WCAG 2.1, 1.4.3


def luminance(colour: str) -> float:
    """WCAG 2.1, relative luminance."""
    red, green, blue = (
        value / 12.92 if value <= 0.03928 else ((value + 0.055) / 1.055) ** 2.4
        for value in rgb(colour)
    )
    return 0.2126 * red + 0.7152 * green + 0.0722 * blue


def contrast(one: str, other: str) -> float:
    darker, lighter = sorted((luminance(one), luminance(other)))
    return (lighter + 0.05) / (darker + 0.05)


@pytest.mark.parametrize("palette", [LIGHT, DARK], ids=["light", "dark"])
@pytest.mark.parametrize("name", TEXT_COLOURS)
def test_text_is_legible_in_every_colour(palette: Palette, name: str):
    for background in (palette.card, palette.hover, palette.page):
        assert contrast(palette.colour(name), background) >= ENOUGH, background


@pytest.mark.parametrize("palette", [LIGHT, DARK], ids=["light", "dark"])
def test_each_condition_has_a_colour_of_its_own(palette: Palette):
    colours = {palette.of_node(Role.ROUTER, condition) for condition in Condition}
    colours.add(palette.of_node(Role.GATEWAY, Condition.CONNECTED))
    assert len(colours) == len(Condition) + 1


def test_flying_has_one_colour_for_node_and_path_and_for_gateways_too():
    for palette in (LIGHT, DARK):
        assert palette.of_node(Role.GATEWAY, Condition.FLYING) == palette.path == palette.flying


def test_the_page_gets_both_palettes_as_variables():
    light, dark = css_variables(LIGHT), css_variables(DARK)
    assert light.startswith("color-scheme: light; --gateway: #6d3fd1; ")
    assert dark.startswith("color-scheme: dark; --gateway: #b193ff; ")
    for use in LinkUse:
        assert f"--{use.name.lower()}-link: {LIGHT.of_link(use)};" in light


def test_no_view_has_colours_of_its_own():
    sources = [
        *(PACKAGE / "console" / "static").glob("*.*s*"),
        *(PACKAGE / "console" / "static").glob("*.html"),
        *(path for room in ("view", "report", "ros/views") for path in (PACKAGE / room).glob("*")),
    ]
    assert len(sources) > 30
    typed = {
        path.name: found
        for path in sources
        if path.is_file() and path.name not in ("palette.py", "icon.svg")
        if (found := re.findall(COLOUR, path.read_text("utf-8")))
    }
    assert typed == {}
