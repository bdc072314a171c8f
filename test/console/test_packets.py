"""Packets of the mesh as dots that run along links."""

from __future__ import annotations

from typing import Iterator

from conftest import MOVING, Visit, page_of

HASTE = ("--skip", "5", "--haste", "5")
SPACING_M = 6.0  # of the grid

# Records where dots are drawn from now on: [x, y, colour] in page pixels of the map.
RECORD = """() => {
  const context = document.querySelector("#packets").getContext("2d");
  window.dots = [];
  const arc = context.arc.bind(context), fill = context.fill.bind(context);
  let at = null;
  context.arc = (x, y, ...rest) => { at = [x, y]; arc(x, y, ...rest); };
  context.fill = () => { window.dots.push([...at, context.fillStyle]); fill(); };
}"""


def drawn(page: Visit) -> int:
    return int(page.page.get_attribute("#packets", "data-drawn") or 0)


def distances_to_links(page: Visit, dots: list[tuple[float, float, str]]) -> Iterator[float]:
    """From each of these points of the map to the nearest link of the grid, in widths of a cell.

    Neighbours over a corner hear each other, too: 8.5 of 9 m.
    """
    note = page.page.locator("#map-note")
    x_m, y_m, scale = (float(note.get_attribute(f"data-{n}")) for n in ("x", "y", "scale"))
    size = page.page.locator("#map").bounding_box()
    assert size is not None
    for x, y, _colour in dots:
        column = (x_m + (x - size["width"] / 2) / scale) / SPACING_M
        row = (y_m - (y - size["height"] / 2) / scale) / SPACING_M
        diagonals = (off_whole(column - row) / 2**0.5, off_whole(column + row) / 2**0.5)
        yield min(off_whole(column), off_whole(row), *diagonals)


def off_whole(value: float) -> float:
    return abs(value - round(value))


page = page_of(*HASTE, **MOVING)


def test_packets_run_along_links_in_the_colours_of_the_legend(page):
    page.wait_for("dots", lambda: drawn(page) > 0)
    page.page.evaluate(RECORD)
    page.wait_for("more of them", lambda: page.page.evaluate("dots.length") > 200)
    dots = page.page.evaluate("dots.slice(0, 200)")
    heartbeat = page.page.evaluate(
        "getComputedStyle(document.documentElement).getPropertyValue('--packet-heartbeat').trim()"
    )
    assert heartbeat in {colour for _x, _y, colour in dots}
    near = [distance < 0.1 for distance in distances_to_links(page, dots)]
    assert sum(near) > 150  # the gateway stands beside the grid
    assert "heartbeat" in page.page.inner_text("#packets-legend")


def test_dots_can_be_switched_off_and_there_are_none_in_the_past(page):
    page.wait_for("dots", lambda: drawn(page) > 0)
    page.page.click("#show-packets")
    page.wait_for("no legend", lambda: not page.page.is_visible("#packets-legend"))
    carried = page.page.get_attribute("#packets", "data-carried")
    before_s = float(page.page.inner_text("#clock").split()[0])
    page.wait_for(
        "time passes", lambda: float(page.page.inner_text("#clock").split()[0]) > before_s + 5
    )
    assert page.page.get_attribute("#packets", "data-carried") == carried
    page.page.click("#show-packets")
    page.wait_for(
        "dots again", lambda: page.page.get_attribute("#packets", "data-carried") != carried
    )
    page.page.locator("#time").press("Home")
    page.wait_for("the past", lambda: page.page.is_visible("#past"))
    assert not page.page.is_visible("#packets-legend")


def test_with_reduced_motion_there_are_no_dots_until_they_are_switched_on(start_console, visit):
    page = visit(start_console(*HASTE).url)
    page.wait_for_drones(18)
    assert not page.page.is_checked("#show-packets")
    page.page.click("#show-packets")
    page.wait_for("dots", lambda: drawn(page) > 0)
