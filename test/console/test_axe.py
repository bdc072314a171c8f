"""axe-core finds no violation in any state of the page."""

from __future__ import annotations

import pytest
from axe_playwright_python.base import AXE_SCRIPT, AxeResults
from conftest import MOVING, Visit

HASTE = ("--skip", "25", "--haste", "5", "--routers", "8")  # each row of the table costs time

# An order stays held: axe may take longer than five seconds on a slow machine.
KEEP_HELD = """() => {
  const after = window.setTimeout;
  window.setTimeout = (act, ms, ...rest) => (ms === 5000 ? 0 : after(act, ms, ...rest));
}"""


ONLY_VIOLATIONS = {"resultTypes": ["violations"]}  # takes half the time
OF_COLOURS = ["color-contrast", "link-in-text-block"]


def check(page: Visit, state: str) -> None:
    """All rules on the light page, and on the dark one those that depend on colours."""
    if not page.page.evaluate("'axe' in window"):
        page.page.evaluate(AXE_SCRIPT)
    dark = {"runOnly": OF_COLOURS, **ONLY_VIOLATIONS}
    for scheme, options in (("light", ONLY_VIOLATIONS), ("dark", dark)):
        page.page.emulate_media(color_scheme=scheme)
        results = AxeResults(page.page.evaluate("(options) => axe.run(options)", options))
        assert results.violations_count == 0, f"{state}, {scheme}: {results.generate_report()}"


def hear(page: Visit) -> None:
    """Wait for a state of the mesh: the page hears none while axe runs, and then sends no order."""
    clock = page.page.inner_text("#clock")
    page.wait_for("a new state", lambda: page.page.inner_text("#clock") != clock)


@pytest.mark.parametrize("size", [(1400, 880), (390, 780)], ids=["desk", "phone"])
def test_axe_finds_no_violation(start_console, visit, size):
    width, height = size
    page = visit(start_console(*HASTE).url, viewport={"width": width, "height": height}, **MOVING)
    page.wait_for_drones(9)
    keyboard = page.page.keyboard
    page.wait_for("packets", lambda: page.page.inner_text("#packets-legend") != "")
    check(page, "nothing selected")
    if width < 500:
        page.page.check("#show-legend")
        check(page, "the legend")
    page.page.uncheck("#show-packets")  # to draw them 30 times a second takes longer than axe
    page.page.focus("#map")  # in a field, keys would be text
    hear(page)
    keyboard.press("n")
    keyboard.press("p")
    page.page.wait_for_selector(".toast button")
    check(page, "a node, and a toast with a button")
    page.wait_for("an alarm", lambda: page.page.is_visible("#alarm-count"))
    check(page, "alarms")
    if width < 500:
        for tab in ("nodes", "events", "charts", "map"):
            page.page.click(f"nav button[data-tab={tab}]")
            check(page, f"the tab {tab}")
    page.page.fill("#fly-z", "1.5")
    page.page.press("#fly-z", "Enter")
    page.wait_for("a refusal", lambda: page.page.inner_text("#fly-error") != "")
    check(page, "a refused position")
    page.page.fill("#fly-z", "0")
    page.page.fill("#fly-y", "90")
    page.page.press("#fly-y", "Enter")
    page.wait_for("the question", lambda: page.page.is_visible("#confirm"))
    check(page, "the question before a long flight")
    page.page.evaluate(KEEP_HELD)
    page.page.click("#confirm >> text=Send")
    page.page.click("#confirm:has-text('gateway') >> text=Send")
    page.wait_for("a held order", lambda: page.page.is_visible("#held"))
    check(page, "a held order")
    page.page.click("#held-undo")
    page.page.click("#add")
    page.page.fill("#add-x", "far")
    page.page.press("#add-x", "Enter")
    check(page, "a drone to add, at a refused place")
    page.page.click("#add-close")
    page.page.click("#help-button")
    check(page, "the keys")
    keyboard.press("Escape")
    page.page.locator("#time").press("Home")
    page.wait_for("the past", lambda: page.page.is_visible("#past"))
    check(page, "the past")
    page.page.click("#time-live")
    page.wait_for("the present", lambda: not page.page.is_visible("#past"))
    if width > 500:
        page.page.click("#nodes tr[data-id='3']")
        page.page.click("#nodes tr[data-id='4']", modifiers=["Shift"])
        page.wait_for("the group", lambda: page.page.is_visible("#group"))
        check(page, "several drones")
        page.page.click("#group-formation")
        check(page, "a formation")
        page.page.click("#formation-close")
        page.page.check("#only-problems")
        check(page, "only problems")
        page.page.uncheck("#only-problems")
        page.page.click("#files-button")
        check(page, "save and load")
        keyboard.press("Escape")
    page.page.click("#demonstrate")
    page.wait_for("the question before it", lambda: page.page.is_visible("#confirm"))
    check(page, "the question before a demonstration")
    hear(page)
    page.page.click("#confirm >> text=Show it")
    page.wait_for("the story", lambda: page.page.is_visible("#story-card"))
    check(page, "a demonstration")


def test_axe_finds_no_violation_on_a_recording(start_console, visit):
    page = visit(start_console(*HASTE, "--recording", "run.bag", "--recorded", "40").url, **MOVING)
    page.wait_for_drones(9)
    page.wait_for("the badge", lambda: page.page.is_visible("#badge"))
    check(page, "a recording that is played")
    page.page.locator("#time").press("End")
    check(page, "another moment of it")
