"""Many drones are selected at once and sent into a formation."""

from __future__ import annotations

import json

from conftest import Visit
from test_page import PLACES, on_screen

STATE = 2  # column of the table


def count(page: Visit) -> str:
    return page.page.inner_text("#group-count")


def test_a_lasso_selects_the_drones_inside(page):
    page.page.keyboard.press("l")
    corners = [(-1.8, 9.0), (9.0, 9.0), (9.0, 12.8), (-1.8, 12.8)]
    page.page.mouse.move(*on_screen(page, *corners[0]))
    page.page.mouse.down()
    for corner in corners[1:]:
        page.page.mouse.move(*on_screen(page, *corner), steps=3)
    page.page.mouse.up()
    page.wait_for("13 and 14", lambda: count(page) == "2 drones: 13, 14")
    page.page.keyboard.press("Escape")  # ends the lasso, not the selection
    assert page.page.get_attribute("#lasso", "aria-pressed") == "false"
    assert count(page) == "2 drones: 13, 14"


def test_a_lasso_takes_no_gateway(page):
    page.page.keyboard.press("l")
    corners = [(-1.8, -1.0), (-1.8, 12.8), (31.0, 12.8), (31.0, -1.0)]
    page.page.mouse.move(*on_screen(page, *corners[0]))
    page.page.mouse.down()
    for corner in corners[1:]:
        page.page.mouse.move(*on_screen(page, *corner), steps=3)
    page.page.mouse.up()
    page.wait_for("all routers", lambda: count(page).startswith("17 drones: 1, 2, 3"))


def test_a_rule_or_a_named_group_selects_drones(page):
    page.page.select_option("#rule", "rule all routers")
    page.wait_for("all", lambda: count(page).startswith("17 drones: 1, 2, 3"))
    page.page.fill("#filter", "17")
    page.page.select_option("#rule", "rule rows shown in the table")
    assert page.page.inner_text("#node-name") == "Router 17"
    page.page.fill("#filter", "")
    page.page.click("#nodes tr[data-id='12']", modifiers=["Shift"])
    page.page.fill("#group-name", "east")
    page.page.press("#group-name", "Enter")
    page.page.click("#group-clear")
    page.page.reload()
    page.wait_for_drones(len(PLACES))
    page.page.select_option("#rule", "group east")
    page.wait_for("the group", lambda: count(page) == "2 drones: 12, 17")
    page.page.select_option("#rule", "rule switched off")
    page.page.wait_for_selector("#toasts :text('no drone: switched off')")


def test_a_formation_is_previewed_and_sent(page):
    page.page.select_option("#rule", "rule all routers")
    page.page.click("#group-formation")
    text = page.page.locator("#formation-text")
    assert text.inner_text().startswith("17 drones around 14.1, 5.6 m.")
    page.page.fill("#formation-spacing", "30")
    page.wait_for("who is lost", lambda: "would have no route" in text.inner_text())
    page.page.fill("#formation-spacing", "0")
    page.wait_for("why not", lambda: "spacing must be" in page.page.inner_text("#formation-error"))
    page.page.fill("#formation-spacing", "5")
    page.page.select_option("#formation-shape", "grid")
    page.page.mouse.click(*on_screen(page, 9.0, 8.0))
    page.wait_for("its middle", lambda: "around 9" in text.inner_text())
    page.answer_held("#held-now")
    page.page.click("#formation-send")
    assert page.wait_for_held() == "17 drones: grid will leave"
    page.wait_for(
        "they fly", lambda: page.page.locator("#nodes tr[data-condition=flying]").count() > 5
    )


def test_a_real_gateway_is_asked_before_drones_of_a_formation_stand_too_near(start_console, visit):
    page = visit(start_console("--real", "--skip", "25").url)
    page.wait_for_drones(len(PLACES))
    for drone in (16, 17):
        page.page.click(f"#nodes tr[data-id='{drone}']", modifiers=["Shift"])
    page.page.click("#group-formation")
    page.page.fill("#formation-spacing", "0.5")
    page.answer_held("#held-now")
    page.page.click("#formation-send")
    page.wait_for("the question", lambda: page.page.is_visible("#confirm"))
    question = page.page.inner_text("#confirm-text")
    assert "flies to a place 0.5 m from there. Send it all the same?" in question


SHAPES = """async () => {
  const { assigned, placesOf } = await import("/static/formations.js");
  const places = (shape, n, heading) => placesOf(shape, n, 2, [10, 20], heading);
  const rounded = (list) => list.map((at) => at.map((value) => Math.round(10 * value) / 10 + 0));
  const drones = [{ id: 1, position: [9, 20, 0] }, { id: 2, position: [11, 20, 0] }];
  return {
    line: rounded(places("line", 3, 0)),
    turned: rounded(places("line", 3, 90)),
    ring: rounded(places("ring", 4, 0)),
    grid: rounded(places("grid", 4, 0)),
    V: rounded(places("V", 3, 0)),
    assigned: assigned(drones, [[12, 20], [8, 20]]),
  };
}"""


def test_the_shapes_have_their_spacing_middle_and_heading(page):
    shapes = page.page.evaluate(SHAPES)
    assert shapes["line"] == [[8, 20], [10, 20], [12, 20]]
    assert shapes["turned"] == [[10, 22], [10, 20], [10, 18]]
    assert sorted(shapes["ring"]) == [[8.6, 20], [10, 18.6], [10, 21.4], [11.4, 20]]
    assert sorted(shapes["grid"]) == [[9, 19], [9, 21], [11, 19], [11, 21]]
    assert shapes["V"] == [[10, 20.7], [11.4, 19.3], [8.6, 19.3]]
    moves = {move["id"]: (move["x"], move["y"]) for move in shapes["assigned"]}
    assert moves == {1: (8, 20), 2: (12, 20)}, json.dumps(shapes)
