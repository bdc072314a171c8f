"""What an operator needs beyond one order at a time."""

from __future__ import annotations

import math
import re
from pathlib import Path

import pytest
from conftest import Visit
from test_page import FAR_FROM_17, PLACES, STATE, X, Y, on_screen

FAST = ("--skip", "25")


@pytest.fixture
def page(page: Visit) -> Visit:
    page.wait_for("all routes", lambda: page.drawn("route-links") == 17)
    return page


def drag(page: Visit, node: int, x: float, y: float) -> None:
    start, goal = on_screen(page, *PLACES[node]), on_screen(page, x, y)
    page.page.mouse.move(*start)
    page.page.mouse.down()
    page.page.mouse.move((start[0] + goal[0]) / 2, start[1], steps=4)
    page.page.mouse.move(*goal, steps=4)
    page.page.mouse.up()


def test_a_drag_can_be_undone(page):
    page.answer_held("#held-undo")
    drag(page, 17, 27.0, 9.0)
    assert "Drone 17 will leave to 27" in page.wait_for_held()
    page.wait_for("the offer is gone", lambda: not page.page.is_visible("#held"))
    assert "not sent: Drone 17 will leave to 27" in page.page.inner_text(".toast")
    page.page.wait_for_timeout(5500)  # as long as it would have been held
    assert page.row(17, STATE) == "connected"


def test_a_drag_can_be_sent_at_once(page):
    page.answer_held("#held-now")
    drag(page, 17, *FAR_FROM_17)
    page.wait_for("17 flies", lambda: page.row(17, STATE) == "flying")
    order = page.page.locator("#node-facts div:has(dt:text-is('Latest order')) dd")
    page.wait_for("the order is followed", lambda: "under way" in order.inner_text())
    page.page.select_option("#speed", "5")
    page.wait_for("its end", lambda: "arrived" in order.inner_text())
    page.wait_for(
        "17 at its goal",
        lambda: math.dist((float(page.row(17, X)), float(page.row(17, Y))), FAR_FROM_17) < 0.3,
    )


def test_a_layout_can_be_undone_before_it_leaves_or_be_sent_at_once(page):
    page.undo_next()
    page.answer_held("z")
    page.page.click("#layout-form button")
    assert page.wait_for_held() == "Layout 0: 17 drones will leave"
    page.wait_for("the offer is gone", lambda: not page.page.is_visible("#held"))
    page.answer_held("#held-now")
    page.page.select_option("#layout", "100")
    page.page.click("#layout-form button")
    page.wait_for_toasts("not sent: Layout 0: 17 drones will leave", "ordered layout 100")


def test_a_layout_that_is_far_away_is_confirmed(start_console, visit):
    page = visit(start_console("--routers", "4", "--gridsize", "1", *FAST).url)
    page.wait_for_drones(5)
    page.page.select_option("#layout", "998")
    page.page.click("#layout-form button")
    page.wait_for("the question", lambda: page.page.is_visible("#confirm"))
    assert page.page.inner_text("#confirm-text") == (
        "Layout 998: 2 drones (1 not in this fleet) would fly 60 m at most."
    )
    page.page.click("#confirm >> text=Cancel")
    page.wait_for("no question", lambda: not page.page.is_visible("#confirm"))
    assert not page.page.is_visible("#held")


def test_a_held_layout_says_who_would_be_out_of_reach(start_console, visit):
    page = visit(start_console("--routers", "4", "--gridsize", "1").url)
    page.wait_for_drones(5)
    page.page.click("#layout-form button")
    words = (
        "Layout 0: 4 drones (13 not in this fleet) will leave: 4 drones would be out of reach: 1..4"
    )
    page.wait_for("who", lambda: page.page.inner_text("#held-text").startswith(words))


def test_a_flight_out_of_reach_waits_until_the_user_sends_it(page):
    page.page.click("#nodes tr[data-id='17']")
    page.page.fill("#fly-x", "40")
    page.page.press("#fly-x", "Enter")
    held = page.page.locator("#held-text")
    words = ": drone 17 would have no route there. It waits for you"
    page.wait_for("why it waits", lambda: held.inner_text().endswith(words))
    page.page.wait_for_timeout(5500)  # longer than other orders are held
    assert page.row(17, STATE) == "connected"
    page.page.click("#held-now")
    page.wait_for("17 flies", lambda: page.row(17, STATE) == "flying")


def test_another_order_does_not_send_one_that_waits(page):
    page.page.click("#nodes tr[data-id='17']")
    page.page.fill("#fly-x", "40")
    page.page.press("#fly-x", "Enter")
    held = page.page.locator("#held-text")
    page.wait_for("a warning", lambda: "no route there" in held.inner_text())
    page.page.click("#nodes tr[data-id='16']")
    page.page.press("#fly-x", "Enter")
    dropped = "not sent: Drone 17 will leave to 40"
    page.wait_for("the word", lambda: dropped in page.page.inner_text("#toasts"))


def test_all_places_of_a_held_layout_come_into_view_although_the_user_has_moved_the_map(page):
    for _ in range(4):
        page.page.click("#zoom-in")
    page.page.select_option("#layout", "100")
    page.page.click("#layout-form button")
    page.page.wait_for_selector("#held:visible")
    canvas = page.page.locator("#map").bounding_box()
    tools = page.page.locator("#map-top").bounding_box()
    assert canvas is not None
    assert tools is not None

    def in_view(x: float, y: float) -> bool:
        px, py = on_screen(page, x, y)
        across = canvas["x"] < px < canvas["x"] + canvas["width"]
        return across and tools["y"] + tools["height"] < py < canvas["y"] + canvas["height"]

    corners = [(5.0, 0.0), (5.0, 45.0), (10.0, 30.0)]  # of the goals of 1 to 17
    page.wait_for("all of it in view", lambda: all(in_view(*corner) for corner in corners))


def test_a_drone_is_sent_from_where_it_is_and_not_from_where_it_was_selected(page):
    page.page.click("#nodes tr[data-id='17']")
    page.page.fill("#fly-y", "11")
    page.answer_held("#held-now")
    drag(page, 17, *FAR_FROM_17)
    page.page.select_option("#speed", "10")
    shown = page.page.locator("#fly-x")
    page.wait_for("its goal", lambda: abs(float(shown.input_value()) - FAR_FROM_17[0]) < 0.3)
    assert page.page.input_value("#fly-y") == "11"  # what was typed stays
    page.answer_held("#held-undo")
    page.page.press("#fly-y", "Enter")
    assert page.wait_for_held() == f"Drone 17 will leave to {shown.input_value()}, 11"


def test_power_and_speed_are_restored_from_the_toast(page):
    page.page.click("#nodes tr[data-id='5']")
    page.undo_next()
    page.page.click("#power")
    page.wait_for_toasts("node 5 is off", "node 5 is on")
    page.undo_next()
    page.page.select_option("#speed", "5")
    page.wait_for_toasts("speed 5", "speed 1")


def test_a_flight_of_more_than_fifty_metres_is_confirmed(page):
    page.page.click("#nodes tr[data-id='13']")
    page.page.fill("#fly-x", "0")
    page.page.fill("#fly-y", "70")
    page.page.click("#fly-form button")
    page.wait_for("the question", lambda: page.page.is_visible("#confirm"))
    assert page.page.inner_text("#confirm-text") == "Drone 13 would fly 58 m."
    page.page.click("#confirm >> text=Cancel")
    page.page.wait_for_timeout(500)
    assert page.row(13, STATE) == "connected"
    page.page.click("#fly-form button")
    page.answer_held("#held-now")
    page.page.click("#confirm >> text=Send")
    page.wait_for("13 flies", lambda: page.row(13, STATE) == "flying")


def test_an_order_onto_the_place_of_another_drone_is_confirmed(page):
    page.page.click("#nodes tr[data-id='17']")
    page.page.fill("#fly-x", str(PLACES[16][0] + 0.5))
    page.page.fill("#fly-y", str(PLACES[16][1]))
    page.answer_held("#held-now")
    page.page.click("#fly-form button")
    page.wait_for("the question", lambda: page.page.is_visible("#confirm"))
    question = "Drone 17: drone 16 stands 0.5 m from there. Send it all the same?"
    assert page.page.inner_text("#confirm-text") == question
    page.page.click("#confirm >> text=Cancel")
    page.page.wait_for_timeout(500)
    assert page.row(17, STATE) == "connected"
    page.answer_held("#held-now")
    page.page.click("#fly-form button")
    page.page.click("#confirm button >> text=Send")
    page.wait_for("17 flies", lambda: page.row(17, STATE) == "flying")


def test_several_drones_are_switched_together(page):
    page.page.click("#nodes tr[data-id='6']")
    for node in (12, 17):  # not by mouse: the panel above the table grows when its facts arrive
        page.page.dispatch_event(f"#nodes tr[data-id='{node}']", "click", {"shiftKey": True})
    assert page.page.inner_text("#group-count") == "3 drones: 6, 12, 17"
    page.page.click("#group-off")
    page.wait_for("all are off", lambda: all(page.row(n, STATE) == "off" for n in (6, 12, 17)))
    page.page.click("#group-on")
    page.wait_for("none is off", lambda: all(page.row(n, STATE) != "off" for n in (6, 12, 17)))
    page.undo_next()
    page.page.click("#group-off")
    page.wait_for_toasts("3 nodes are off", "3 nodes are on")
    page.page.click("#group-clear")
    assert not page.page.is_visible("#group")


def test_several_drones_are_moved_together(page):
    page.page.mouse.click(*on_screen(page, *PLACES[16]))
    page.page.keyboard.down("Shift")
    page.page.mouse.click(*on_screen(page, *PLACES[17]))
    page.page.keyboard.up("Shift")
    page.answer_held("#held-now")
    page.undo_next()  # there is no toast to undo; it notes the texts of all
    drag(page, 17, 9.0, 3.0)  # and 16 to (3, 3)
    page.wait_for("both fly", lambda: all(page.row(n, STATE) == "flying" for n in (16, 17)))
    page.wait_for_toasts("2 drones: ordered 2 of 2 drones")


def test_a_link_selects_a_node_and_a_selection_makes_a_link(start_console, visit):
    page = visit(f"{start_console(*FAST).url}#node=3")
    page.wait_for("node 3", lambda: page.page.inner_text("#node-name") == "Router 3")
    page.page.click("#nodes tr[data-id='5']")
    page.wait_for("the link of 5", lambda: page.page.url.endswith("#node=5"))


@pytest.mark.parametrize("words", ["node=77", "node=1.2.3", "node=77&t=1..2"])
def test_who_selects_a_node_no_longer_waits_for_the_one_of_the_link(start_console, visit, words):
    page = visit(f"{start_console(*FAST).url}#{words}")
    page.page.click("#nodes tr[data-id='5']")
    page.wait_for("the link of 5", lambda: page.page.url.endswith("#node=5"))


def test_the_map_follows_a_drone(page):
    page.page.click("#nodes tr[data-id='17']")
    page.page.click("#follow")
    page.wait_for(
        "17 in the middle",
        lambda: abs(float(page.page.get_attribute("#map-note", "data-x")) - PLACES[17][0]) < 0.5,
    )


def test_a_removed_drone_is_no_longer_followed(page):
    page.page.click("#nodes tr[data-id='17']")
    page.page.click("#follow")
    page.page.click("#remove")
    page.page.click("#confirm >> text=Remove 17")
    page.wait_for("17 drones", lambda: page.drawn("drones") == 17)
    assert not page.page.is_checked("#follow")
    page.page.click("#nodes tr[data-id='5']")
    page.page.click("#follow")
    assert page.page.is_checked("#follow")


def saved(page: Visit, button: str, folder: Path) -> Path:
    if not page.page.is_visible("#files"):
        page.page.click("#files-button")
    with page.page.expect_download() as download:
        page.page.click(button)
    path = folder / download.value.suggested_filename
    download.value.save_as(path)
    return path


def test_table_and_charts_are_saved_as_csv_and_png(page, tmp_path):
    page.wait_for("a chart", lambda: page.page.inner_text("#share-now") == "100 %")
    page.page.click("#nodes tr[data-id='17']")
    page.page.click("#power")
    page.wait_for("a missing number", lambda: page.row(17, 4) == "–")
    nodes = saved(page, "#save-nodes", tmp_path).read_text().splitlines()
    assert nodes[0].startswith("node,role,condition,gateway,hops")
    assert len(nodes) == 1 + len(PLACES)
    assert nodes[1].startswith("0,gateway,connected,0,0")
    assert "–" not in nodes[18]
    charts = saved(page, "#save-charts", tmp_path).read_text().splitlines()
    assert "routers_connected" in charts[0]
    assert len(charts) > 2
    for button, rows in (("#save-nodes-picture", 1 + len(PLACES)), ("#save-charts-picture", 3)):
        picture = saved(page, button, tmp_path).read_bytes()
        assert picture[:8] == b"\x89PNG\r\n\x1a\n"
        assert int.from_bytes(picture[20:24], "big") > 20 * rows  # its height, PNG 11.2.2


def test_places_are_saved_and_flown_to_again(page, tmp_path):
    path = saved(page, "#save-places", tmp_path)
    text = path.read_text()
    assert re.search(r"^    17: \[24, 12, 0\]$", text, re.MULTILINE)
    path.write_text("cases:\n  1:\n    17: [3, 3, 0]\n")
    page.answer_held("#held-now")
    page.page.set_input_files("#load-places", str(path))
    assert page.wait_for_held() == "places.yaml: Drone 17 will leave to 3, 3"
    page.wait_for("17 flies", lambda: page.row(17, STATE) == "flying")


def test_an_invalid_layout_file_is_refused_with_its_line(page, tmp_path):
    path = tmp_path / "wrong.yaml"
    path.write_text("cases:\n  1:\n    17: [far, 14, 0]\n")
    page.page.click("#files-button")
    page.page.set_input_files("#load-places", str(path))
    page.wait_for("the reason", lambda: "line 3" in page.page.inner_text("#toasts"))


def test_a_drone_is_added_with_a_click_on_the_map_and_removed_again(page):
    page.page.click("#add")
    assert page.page.get_attribute("#add-id", "placeholder") == "lowest free (18)"
    page.page.mouse.click(*on_screen(page, 30.0, 15.0))
    assert page.page.input_value("#add-x") in ("29.9", "30", "30.1")
    page.page.fill("#add-y", "14")
    page.page.click("#add-form [type=submit]")
    page.wait_for("what came of it", lambda: toast(page) == "added router 18 at x 30 m, y 14 m")
    page.wait_for("19 drones", lambda: page.drawn("drones") == 19)
    assert not page.page.is_visible("#add-form")
    page.page.mouse.click(*on_screen(page, 30.0, 14.0))  # a click selects again
    assert page.page.inner_text("#node-name") == "Router 18"
    page.page.click("#remove")
    assert "Router 18 will be removed from the simulation" in page.page.inner_text("#confirm-text")
    page.page.click("#confirm >> text=Cancel")
    assert page.drawn("drones") == 19
    page.page.click("#remove")
    page.page.click("#confirm >> text=Remove 18")
    page.wait_for("18 drones", lambda: page.drawn("drones") == 18)
    assert page.page.is_visible("#node-none")


def test_a_gateway_is_added_and_removed_by_keyboard(page):
    keyboard = page.page.keyboard
    keyboard.press("a")
    keyboard.type("-3,5")
    keyboard.press("Tab")
    keyboard.type("far")
    keyboard.press("Enter")
    page.wait_for("a reason", lambda: "y must be a number" in page.page.inner_text("#add-error"))
    assert page.page.get_attribute("#add-y", "aria-invalid") == "true"
    keyboard.type("8")  # the field that is wrong is selected
    page.page.select_option("#add-role", "gateway")
    page.page.fill("#add-id", "3")
    page.page.press("#add-id", "Enter")
    page.wait_for("a refusal", lambda: "exists already" in toast(page))
    page.page.fill("#add-id", "200")
    page.page.press("#add-id", "Enter")
    page.wait_for("gateway 200", lambda: page.page.locator("#nodes tr[data-id='200']").count() == 1)
    page.page.fill("#find", "200")
    page.page.press("#find", "Enter")
    assert page.page.inner_text("#node-name") == "Gateway 200"
    keyboard.press("Delete")
    keyboard.press("Tab")  # from "Cancel", which has the focus
    keyboard.press("Enter")
    page.wait_for("it is gone", lambda: page.drawn("drones") == 18)
    keyboard.press("a")
    keyboard.press("Escape")  # leaves the field
    keyboard.press("Escape")
    assert not page.page.is_visible("#add-form")


def test_the_page_of_a_real_mesh_offers_only_what_its_gateway_can_carry_out(start_console, visit):
    page = visit(start_console("--real", *FAST).url)
    page.wait_for_drones(len(PLACES))
    for key in ("n", "a", "Delete"):
        page.page.keyboard.press(key)
    assert page.page.is_visible("#fly-form [type=submit]")
    for order in ("#power", "#pause", "#demonstrate", "#add", "#add-form", "#remove", "#confirm"):
        assert not page.page.is_visible(order), order


def toast(page: Visit) -> str:
    """The latest one."""
    return str(page.page.evaluate("document.querySelector('#toasts').lastChild?.textContent ?? ''"))


def test_a_mission_is_drawn_by_clicks_and_sent_to_the_selected_drone(page):
    page.page.mouse.click(*on_screen(page, *PLACES[17]))
    page.page.click("#mission")
    assert page.page.inner_text("#mission-text") == "0 waypoints, drone 17"
    assert page.page.is_disabled("#mission-send")
    for x, y in ((20.0, 4.0), (24.0, 4.0), (24.0, 8.0)):
        page.page.mouse.click(*on_screen(page, x, y))
    page.page.click("#mission-back")
    assert page.page.inner_text("#mission-text") == "2 waypoints, drone 17"
    page.page.fill("#mission-speed", "fast")
    page.page.click("#mission-send")
    assert page.page.inner_text("#mission-error") == "speed must be a number from 0.01 to 20"
    page.page.fill("#mission-speed", "0.5")
    page.page.click("#mission-send")
    page.wait_for("what came of it", lambda: toast(page) == "the mission of 1 drones has begun")
    assert not page.page.is_visible("#mission-form")


def test_missions_are_paused_and_aborted_for_all_drones(page):
    page.page.click("#mission")
    assert page.page.inner_text("#mission-text") == "0 waypoints, no drone: select one first"
    page.page.click("#mission-stop")
    page.wait_for("what came of it", lambda: toast(page) == "no drone has a mission")
    page.page.keyboard.press("Escape")
    assert not page.page.is_visible("#mission-form")
