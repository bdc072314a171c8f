"""The page shows a repair step by step."""

from __future__ import annotations

import re

from axe_playwright_python.sync_playwright import Axe
from conftest import Visit

HASTE = ("--skip", "15", "--spacing", "1", "--haste", "5")
# It may be over before a slow test looks.
WATCH_COUNTDOWN = """() => {
  const wait = document.getElementById("story-wait");
  const look = () => (window.countedDown ||= !wait.hidden);
  new MutationObserver(look).observe(wait, { attributes: true });
}"""
PHONE = {"viewport": {"width": 390, "height": 844}}


def sentences(page: Visit) -> list[str]:
    return page.page.locator("#story li span").all_inner_texts()


def wait_for_sentence(page: Visit, pattern: str, within_s: float = 60.0) -> None:
    page.wait_for(
        f"a sentence like {pattern!r}",
        lambda: any(re.search(pattern, text) for text in sentences(page)),
        within_s,
    )


def test_the_button_shows_a_repair_from_the_loss_to_the_reconnection(start_console, visit):
    page = visit(start_console(*HASTE).url)
    page.wait_for_drones(18)
    page.page.click("#demonstrate")
    page.wait_for("a question", lambda: page.page.is_visible("#confirm"))
    assert "switches 12 others off. Then it switches 2 off" in page.page.inner_text("#confirm-text")
    page.page.click("#confirm >> text=Cancel")
    assert not page.page.is_visible("#story-card")
    page.page.click("#demonstrate")
    page.page.evaluate(WATCH_COUNTDOWN)
    page.page.click("#confirm >> text=Show it")
    wait_for_sentence(page, "12 other drones could provide another route")
    wait_for_sentence(page, "Router 2 is switched off. It was on the route of 3, 4 and 5")
    chain, story = (page.page.locator(part).bounding_box() for part in ("#map", "#story-card"))
    assert story["x"] > chain["x"] + chain["width"], "the story takes height from the map"
    scale = page.page.get_attribute("#map-note", "data-scale")
    page.wait_for("a countdown", lambda: page.page.evaluate("window.countedDown"), 30.0)
    wait_for_sentence(page, r"3 bids 18.0 m, 4 bids 15.5 m, 5 bids 15.3 m")
    wait_for_sentence(page, "3 is farthest .* flies to node 2's place")
    wait_for_sentence(page, "3, 4 and 5 are connected again, [0-9]+ s after node 2 fell silent")
    assert page.page.get_attribute("#map-note", "data-scale") == scale
    wait_for_sentence(page, "Everything is put back: power, places and speed")
    page.wait_for("the end", lambda: page.page.inner_text("#demonstrate") == "Show a repair")
    page.wait_for("all are on", lambda: "off" not in (page.row(17, 2), page.row(2, 2)))
    page.page.click("#story-close")
    page.wait_for("the story closes", lambda: not page.page.is_visible("#story-card"))


def test_a_demonstration_that_was_asked_for_at_the_start_begins_with_the_first_page(
    start_console, visit
):
    page = visit(start_console(*HASTE, "--demonstrate").url, **PHONE)
    wait_for_sentence(page, "The gateway sends five drones out")
    assert page.page.evaluate("document.documentElement.scrollWidth") == 390
    found = Axe().run(page.page)
    assert found.violations_count == 0, found.generate_report()
    page.page.click("#demonstrate")
    wait_for_sentence(page, "Not finished: ended by the user")
    wait_for_sentence(page, "Everything is put back: power, places and speed")
    page.wait_for("the end", lambda: page.page.inner_text("#demonstrate") != "End")


def test_a_fleet_that_is_too_small_is_refused_with_the_reason(start_console, visit):
    page = visit(start_console("--routers", "4", *HASTE).url)
    page.wait_for_drones(5)
    page.page.click("#demonstrate")
    page.page.wait_for_selector("#toasts :text('needs a gateway and 5 routers')")
    assert not page.page.is_visible("#confirm")
