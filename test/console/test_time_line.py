"""The time line of a live run: drag back, play, return to the present."""

from __future__ import annotations

import math

import pytest
from conftest import MOVING, Visit, page_of

HASTE = ("--skip", "5", "--haste", "5")
ORDERS = ("#power", "#fly-form", "#pause", "#layout-form", "#demonstrate", "#add", "#remove")


page = page_of(*HASTE)


def clock_s(page: Visit) -> float:
    """NaN before the page has a state to show."""
    shown = page.page.inner_text("#clock").split()[0]
    return math.nan if shown == "–" else float(shown)


def drag_to(page: Visit, share: float) -> None:
    box = page.page.locator("#time").bounding_box()
    assert box is not None
    page.page.mouse.click(box["x"] + 8 + (box["width"] - 16) * share, box["y"] + box["height"] / 2)


def test_dragging_back_shows_the_past_and_live_returns_to_the_present(page):
    page.wait_for("some time to look back at", lambda: clock_s(page) > 12.0)
    page.page.click("#nodes tr[data-id='5']")
    page.page.click("#power")
    page.wait_for("5 is off", lambda: page.row(5, 2) == "off")
    page.wait_for("a mark", lambda: page.page.locator("#marks .mark.off").count() == 1)
    drag_to(page, 0.0)
    page.wait_for("5 was on", lambda: page.row(5, 2) == "connected")
    page.wait_for("the badge", lambda: page.page.is_visible("#past"))
    assert clock_s(page) < 12.0
    for order in ORDERS:
        assert not page.page.is_visible(order)
    page.page.click("#time-live")
    page.wait_for("the present", lambda: page.row(5, 2) == "off")
    page.wait_for("the orders", lambda: page.page.is_visible("#power"))
    assert not page.page.is_visible("#past")


def test_the_past_can_be_paused_stepped_and_played_until_the_present(page):
    page.wait_for("some time to look back at", lambda: clock_s(page) > 20.0)
    drag_to(page, 0.0)
    page.wait_for("the past", lambda: page.page.is_visible("#time-play"))
    page.page.click("#time-play")
    page.wait_for("it is paused", lambda: page.page.inner_text("#time-play") == "Play")
    before_s = clock_s(page)
    page.page.click("#time-step")
    page.wait_for("a later moment", lambda: clock_s(page) > before_s)
    page.page.select_option("#time-factor", "20")
    page.page.click("#time-play")
    page.wait_for("the present", lambda: page.page.inner_text("#time-now") == "now")


def test_on_a_phone_the_time_line_of_the_past_fits(start_console, visit):
    page = visit(start_console(*HASTE).url, viewport={"width": 390, "height": 844})
    page.wait_for_drones(18)
    page.wait_for("some time to look back at", lambda: clock_s(page) > 20.0)
    drag_to(page, 0.0)
    page.wait_for("the past", lambda: page.page.is_visible("#time-live"))
    assert page.page.evaluate("document.documentElement.scrollWidth") == 390
    box = page.page.locator("#time-live").bounding_box()
    assert box is not None
    assert box["x"] + box["width"] <= 390


def test_one_page_looks_back_while_another_stays_in_the_present(start_console, visit):
    console = start_console(*HASTE)
    page, other = visit(console.url), visit(console.url)
    page.wait_for_drones(18)
    other.wait_for_drones(18)
    page.wait_for("some time to look back at", lambda: clock_s(page) > 12.0)
    drag_to(page, 0.0)
    page.wait_for("the past", lambda: page.page.is_visible("#past"))
    other.wait_for("the same time on the other page", lambda: clock_s(other) > 12.0)
    assert not other.page.is_visible("#past")


def test_the_whole_of_a_recording_can_be_viewed_while_it_is_played(start_console, visit):
    recording = ("--recording", "run.bag", "--recorded", "80")
    page = visit(start_console("--skip", "2", "--haste", "1", *recording).url, **MOVING)
    page.wait_for_drones(18)
    page.wait_for("the badge", lambda: page.page.is_visible("#badge"))
    assert page.page.title() == "run.bag: recording"
    assert "Drag" not in page.page.inner_text("#node-none")
    page.page.click("#nodes tr[data-id='5']")
    for order in ORDERS:
        assert not page.page.is_visible(order)
    assert page.page.inner_text("#time-now").endswith(" of 80 s")
    assert clock_s(page) < 40.0
    drag_to(page, 0.9)
    page.wait_for("later than what was played", lambda: clock_s(page) > 65.0)
    page.wait_for("5 is off by then", lambda: page.row(5, 2) == "off")
    before = int(page.page.get_attribute("#packets", "data-drawn") or 0)
    page.wait_for(
        "dots of that time",
        lambda: int(page.page.get_attribute("#packets", "data-drawn") or 0) > before,
    )
    page.page.click("#time-play")
    page.wait_for("it is paused", lambda: page.page.inner_text("#time-play") == "Play")
    page.page.click("#time-live")
    page.wait_for("where it is played", lambda: clock_s(page) < 60.0)
    assert page.row(5, 2) == "connected"
    before_s = clock_s(page)
    page.page.click("#time-play")
    page.wait_for("a pause there", lambda: page.page.inner_text("#time-play") == "Play")
    assert before_s - 0.5 <= clock_s(page) < 60.0  # the recording has two states a second


def test_a_link_opens_the_moment_and_the_node_that_it_was_copied_from(start_console, visit):
    recording = ("--recording", "run.bag", "--recorded", "80")
    url = start_console("--skip", "2", "--haste", "1", *recording).url
    page = visit(url)
    page.wait_for_drones(18)
    page.page.click("#nodes tr[data-id='5']")
    drag_to(page, 0.9)
    page.wait_for("later than what was played", lambda: clock_s(page) > 65.0)
    page.page.click("#time-link")
    page.wait_for("a link", lambda: "&t=" in page.page.url)
    assert page.page.inner_text("#time-play") == "Play"
    page.wait_for("it says so", lambda: "to this moment" in page.page.inner_text("#toasts"))
    linked_s = float(page.page.url.partition("&t=")[2])
    other = visit(page.page.url)
    at = f"the moment of {page.page.url}, where {page.page.inner_text('#clock')} is shown"
    other.wait_for(at, lambda: clock_s(other) == clock_s(page))
    assert linked_s - 0.6 < clock_s(page) < linked_s + 0.1  # two states a second, one decimal
    other.wait_for("the same node", lambda: other.page.inner_text("#node-name") == "Router 5")
    own = other.page.inner_text("#node-events")
    assert "5 was switched off" in own
    assert "started" in own.splitlines()[-1]
    other.wait_for("it keeps its link", lambda: other.page.url == page.page.url)


def test_a_link_to_a_moment_that_is_not_remembered_says_so_and_shows_the_present(
    start_console, visit
):
    page = visit(start_console(*HASTE).url + "#node=3&t=9999")
    page.wait_for("why", lambda: "9999 s is not on the time line" in page.page.inner_text("body"))
    page.wait_for("the node", lambda: page.page.inner_text("#node-name") == "Router 3")
    page.wait_for("its address", lambda: page.page.url.endswith("#node=3"))
    assert not page.page.is_visible("#past")


@pytest.mark.parametrize("size", [(1400, 880), (390, 844)], ids=["desk", "phone"])
def test_the_track_keeps_its_ends_when_a_drag_enters_the_past(start_console, visit, size):
    page = visit(start_console(*HASTE).url, viewport={"width": size[0], "height": size[1]})
    page.wait_for_drones(18)
    page.wait_for("some time to look back at", lambda: clock_s(page) > 12.0)
    before = page.page.locator("#time").bounding_box()
    drag_to(page, 0.3)
    page.wait_for("the past", lambda: page.page.is_visible("#time-play"))
    after = page.page.locator("#time").bounding_box()
    assert before is not None
    assert after is not None
    assert (before["x"], before["width"]) == (after["x"], after["width"])


def test_the_map_stays_where_it_is_when_the_time_line_appears(start_console, visit):
    page = visit(start_console().url)
    around = page.page.locator("main")  # in it, the legend grows with the first message
    before = around.bounding_box()
    page.wait_for("a time line", lambda: page.page.is_visible("#time"))
    assert around.bounding_box() == before
