"""The page shows the mesh and acts on it."""

from __future__ import annotations

import math
import re

import pytest
from conftest import MOVING, WAIT_WITHIN_S, Visit

# The fleet: gateway 0 at (-1, 0); 17 routers in rows of 6, 6 m apart, in range below 9 m.
PLACES = [(-1.0, 0.0)] + [(6.0 * (k % 6), 6.0 * (k // 6)) for k in range(17)]
LINKS = sum(
    (ax - bx) ** 2 + (ay - by) ** 2 < 81.0
    for i, (ax, ay) in enumerate(PLACES)
    for bx, by in PLACES[:i]
)
STATE, DOES, BATTERY, HOPS, NEXT, NEIGHBOURS, X, Y = 2, 3, 4, 5, 6, 7, 10, 11  # columns
FAST = ("--skip", "25")
FAR_FROM_17 = (3.0, 3.0)  # a flight of eleven seconds: a slow page sees it, too


def on_screen(page: Visit, x: float, y: float) -> tuple[float, float]:
    """Where a place of the world is on the screen."""
    box = page.page.locator("#map").bounding_box()
    assert box is not None
    view = {
        key: float(page.page.get_attribute("#map-note", f"data-{key}"))
        for key in ("x", "y", "scale")
    }
    return (
        box["x"] + box["width"] / 2 + (x - view["x"]) * view["scale"],
        box["y"] + box["height"] / 2 - (y - view["y"]) * view["scale"],
    )


def test_the_page_loads_without_errors_and_from_one_server_only(start_console, visit):
    console = start_console(*FAST)
    page = visit(console.url)
    page.wait_for_drones(len(PLACES))
    page.page.wait_for_timeout(1500)
    assert page.unexpected() == []
    assert {url.split("/")[2] for url in page.requests} == {f"127.0.0.1:{console.port}"}


def test_the_map_shows_the_true_number_of_drones_links_and_routes(shared_page):
    shared_page.wait_for("all links", lambda: shared_page.drawn("links") == LINKS)
    assert shared_page.drawn("links-drawn") == LINKS
    shared_page.wait_for("all routes", lambda: shared_page.drawn("route-links") == 17)
    shared_page.wait_for(
        "all connected",
        lambda: shared_page.page.inner_text("#summary") == "17 of 17 routers connected",
    )


def test_switching_a_node_off_by_click_turns_it_grey_and_the_routes_change(page):
    page.wait_for("all routes", lambda: page.drawn("route-links") == 17)
    before = {node: page.row(node, NEXT) for node in range(1, 18)}
    behind = [node for node, next_hop in before.items() if next_hop == "2"]
    assert behind
    page.page.mouse.click(*on_screen(page, *PLACES[2]))
    assert page.page.inner_text("#node-name") == "Router 2"
    page.page.click("#power")
    page.wait_for("2 is off", lambda: page.row(2, STATE) == "off")
    page.wait_for("the other label", lambda: page.page.inner_text("#power") == "Switch on")
    assert page.page.get_attribute("#nodes tr[data-id='2']", "data-condition") == "off"
    page.wait_for("links to 2 are gone", lambda: page.drawn("links") < LINKS)
    page.page.select_option("#speed", "10")
    page.wait_for(
        "those behind 2 found other routes",
        lambda: all(page.row(node, NEXT) not in ("2", "–") for node in behind),
    )
    page.wait_for("16 routes again", lambda: page.drawn("route-links") == 16)
    page.page.click("#power")
    page.wait_for("2 is back", lambda: page.row(2, STATE) == "connected")


def test_a_drag_that_ends_with_escape_sends_no_drone(page):
    start = on_screen(page, *PLACES[17])
    page.page.mouse.move(*start)
    page.page.mouse.down()
    page.page.mouse.move(start[0] + 80, start[1] - 40, steps=4)
    page.page.keyboard.press("Escape")
    page.page.mouse.up()
    page.page.wait_for_timeout(800)
    assert page.row(17, STATE) == "connected"
    assert page.page.locator(".toast").count() == 0


def test_typed_numbers_send_a_drone(page):
    page.page.click("#nodes tr[data-id='13']")
    page.page.fill("#fly-x", "-3,5")
    page.page.fill("#fly-y", "30")
    page.answer_held("#held-now")
    page.page.click("#fly-form button")
    page.wait_for("13 flies", lambda: page.row(13, STATE) == "flying")


def test_a_goal_that_cannot_be_flown_to_is_refused_beside_the_field(page):
    page.page.click("#nodes tr[data-id='13']")
    for axis, typed, why in (
        ("x", "far away", "x must be a number from -5000 to 5000"),
        ("y", "", "y must be a number from -5000 to 5000"),
        ("x", "5001", "x must be a number from -5000 to 5000"),
        ("z", "-5", "z must be a whole number from 0 to 500"),
        ("z", "1.5", "z must be a whole number from 0 to 500"),
        ("x", "0x10", "x must be a number from -5000 to 5000"),
    ):
        field = f"#fly-{axis}"
        before = page.page.input_value(field)
        page.page.fill(field, typed)
        page.page.click("#fly-form button")
        page.wait_for("a reason", lambda why=why: page.page.inner_text("#fly-error") == why)
        assert page.page.get_attribute(field, "aria-invalid") == "true", typed
        page.page.fill(field, before)
    page.page.wait_for_timeout(500)
    assert page.row(13, STATE) == "connected"


def test_a_layout_starts(page):
    page.page.select_option("#layout", "0")
    page.undo_next()
    page.page.click("#layout-form button")
    page.wait_for_toasts("ordered layout 0")  # sent after five seconds
    page.wait_for(
        "many fly", lambda: page.page.locator("#nodes tr[data-condition=flying]").count() >= 10
    )


def test_an_unknown_layout_is_refused_in_words(page):
    page.page.select_option("#layout", "999")
    page.page.click("#layout-form button")
    page.page.wait_for_selector(".toast.bad")
    assert "unknown case 999: use one of 0..17, 100" in page.page.inner_text(".toast.bad")


def test_pause_stops_the_time_and_speed_changes_it(page):
    def clock() -> float:
        match = re.match(r"([\d.]+) s", page.page.inner_text("#clock"))
        assert match
        return float(match[1])

    page.page.click("#pause")
    page.wait_for("paused", lambda: "paused" in page.page.inner_text("#clock"))
    stood = clock()
    page.page.wait_for_timeout(1000)
    assert clock() == stood
    page.page.click("#pause")
    page.wait_for("time goes on", lambda: clock() > stood)
    page.page.select_option("#speed", "10")
    page.wait_for("ten times as fast", lambda: "10.0×" in page.page.inner_text("#clock"))


def test_a_lost_node_says_what_its_repair_does_and_the_header_names_the_algorithms(page):
    assert page.page.inner_text("#algorithms") == "Routing child_table_tree, repair thesis"
    page.page.click("#nodes tr[data-id='0']")
    page.page.click("#power")  # the gateway is off: every router gets lost
    page.page.select_option("#speed", "10")
    page.page.click("#nodes tr[data-id='17']")
    repair = page.page.locator("#node-facts div:has(dt:text-is('Repair')) dd")
    repair.wait_for(timeout=1000 * WAIT_WITHIN_S)
    assert re.match(
        r"(has no gateway|waits|asks|negotiating|does not fly|flies|lands|has landed)\b",
        repair.inner_text(),
    )


def test_the_keyboard_is_enough_to_switch_a_node_off(page):
    for _ in range(4):
        page.page.keyboard.press("n")
    assert page.page.inner_text("#node-name") == "Router 3"
    page.page.keyboard.press("p")
    page.wait_for("3 is off", lambda: page.row(3, STATE) == "off")
    page.page.keyboard.press("g")
    page.page.keyboard.type("1")
    assert page.page.input_value("#fly-x") == "1"
    page.page.keyboard.press("Escape")
    page.page.keyboard.press("Escape")
    assert page.page.locator("#node-none").is_visible()
    page.page.keyboard.press("?")
    assert page.page.locator("#help").is_visible()


def test_the_tab_key_reaches_every_control_and_arrows_and_enter_do_the_rest(page):
    keyboard = page.page.keyboard
    page.wait_for("a time line", lambda: page.page.is_visible("#time"))
    reached: dict[str, int] = {}
    for presses in range(60):
        keyboard.press("Tab")
        reached.setdefault(page.page.evaluate("document.activeElement.id"), presses)
    controls = "pause speed layout theme files-button help-button map zoom-in fit demonstrate add "
    controls += "show-known show-ranges show-packets follow find events time"
    assert set(controls.split()) <= set(reached)
    page.page.focus("#nodes tbody tr[data-id='3']")
    keyboard.press("Enter")
    keyboard.press("Shift+ArrowDown")
    assert page.page.inner_text("#group-count") == "2 drones: 3, 4"
    page.page.focus("#time")
    keyboard.press("Home")
    page.wait_for("the past", lambda: page.page.is_visible("#past"))
    page.page.focus("#time-live")
    keyboard.press("Enter")
    page.wait_for("the present", lambda: not page.page.is_visible("#past"))
    page.page.focus("#demonstrate")
    keyboard.press("Enter")
    page.wait_for("a question", lambda: page.page.is_visible("#confirm"))
    page.page.focus("#confirm [value=yes]")
    keyboard.press("Enter")
    page.wait_for("a story", lambda: page.page.is_visible("#story-card"))
    assert page.page.evaluate("document.activeElement.id") == "demonstrate"
    for _ in range(2):  # put back, and at once
        keyboard.press("Enter")
    page.wait_for("its end", lambda: page.page.inner_text("#demonstrate") == "Show a repair")


def test_the_map_moves_and_zooms_by_keyboard(page):
    before = on_screen(page, 0.0, 0.0)
    page.page.focus("#map")
    page.page.keyboard.press("ArrowRight")
    page.wait_for("moved", lambda: on_screen(page, 0.0, 0.0)[0] < before[0] - 30)
    scale = float(page.page.get_attribute("#map-note", "data-scale"))
    page.page.keyboard.press("+")
    page.wait_for(
        "zoomed", lambda: float(page.page.get_attribute("#map-note", "data-scale")) > scale
    )
    page.page.keyboard.press("f")
    page.wait_for("fits again", lambda: on_screen(page, 0.0, 0.0) == pytest.approx(before, abs=1.0))


def test_the_table_sorts_by_the_column_that_is_clicked(shared_page):
    ids = "#nodes tbody tr td:first-child"
    shared_page.page.click("#nodes th:nth-child(5) button")
    shared_page.page.click("#nodes th:nth-child(5) button")
    hops = [
        int(h)
        for h in shared_page.page.locator("#nodes tbody tr td:nth-child(5)").all_inner_texts()
    ]
    assert hops == sorted(hops, reverse=True)
    shared_page.page.click("#nodes th:nth-child(1) button")
    assert shared_page.page.locator(ids).all_inner_texts() == [str(n) for n in range(18)]


def test_the_log_shows_events_with_simulated_time_and_neighbours_on_request(page):
    page.page.click("#nodes tr[data-id='2']")
    page.page.click("#power")
    page.page.wait_for_selector("#events li:has-text('2 was switched off')")
    row = page.page.locator("#events li:has-text('2 was switched off')").first.inner_text()
    assert re.match(r"[\d.]+ s\s+2 was switched off", row)
    assert page.page.locator("#events li:has-text('found')").count() == 0
    page.page.check("#show-neighbours")
    page.page.wait_for_selector("#events li:has-text('found')")


def test_the_charts_have_something_to_show(shared_page):
    shared_page.wait_for("a share", lambda: shared_page.page.inner_text("#share-now") == "100 %")
    shared_page.wait_for("a rate", lambda: int(shared_page.page.inner_text("#rate-now")) > 0)
    assert re.fullmatch(r"\d\.\d / \d", shared_page.page.inner_text("#hops-now"))
    shared_page.page.hover("#chart-share")
    assert re.fullmatch(r"100 % at \d+ s", shared_page.page.inner_text("#share-now"))


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_the_page_follows_the_scheme_of_the_system(start_console, visit, scheme):
    page = visit(start_console(*FAST).url, color_scheme=scheme)
    page.wait_for_drones(len(PLACES))
    assert page.page.get_attribute("html", "data-theme") == scheme
    page.page.click("#theme")
    assert page.page.get_attribute("html", "data-theme") != scheme


def test_at_phone_width_nothing_sticks_out_and_each_view_is_one_tap_away(start_console, visit):
    phone = {"viewport": {"width": 390, "height": 780}, "has_touch": True}
    page = visit(start_console(*FAST).url, **phone, **MOVING)
    page.wait_for_drones(len(PLACES))
    for tab, card in (
        ("nodes", "nodes"),
        ("events", "events"),
        ("charts", "charts"),
        ("map", "map"),
    ):
        page.page.tap(f"nav button[data-tab={tab}]")
        assert page.page.locator(f"#{card}-card").is_visible()
        assert page.page.evaluate("document.documentElement.scrollWidth") <= 390
    assert not page.page.is_visible(".legend")
    page.page.tap("#show-legend")
    legend = page.page.locator(".legend").bounding_box()
    assert legend is not None
    assert legend["x"] >= 0
    assert legend["x"] + legend["width"] <= 390
    for entry in ("flying", "silent", "known link", "flight path", "heartbeat"):
        assert page.page.locator(f".legend li:has-text('{entry}')").is_visible()
    page.wait_for(
        "no drone is below the legend",
        lambda: max(on_screen(page, *place)[1] for place in PLACES) < legend["y"],
    )


def test_a_swipe_that_moves_the_map_sends_no_drone_away(start_console, visit):
    page = visit(start_console(*FAST).url, viewport={"width": 390, "height": 780}, has_touch=True)
    page.wait_for_drones(len(PLACES))
    start = on_screen(page, *PLACES[9])
    client = page.page.context.new_cdp_session(page.page)

    def touch(kind: str, x: float, y: float) -> None:
        points = [] if kind == "touchEnd" else [{"x": x, "y": y}]
        client.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})

    touch("touchStart", *start)
    for step in range(1, 6):
        touch("touchMove", start[0] + 12 * step, start[1])
    touch("touchEnd", *start)
    page.wait_for("the map moved", lambda: on_screen(page, *PLACES[9])[0] > start[0] + 30)
    page.page.wait_for_timeout(500)
    assert page.page.locator("#nodes tr[data-condition=flying]").count() == 0


def test_a_node_is_found_by_typing_its_id(page):
    page.page.keyboard.press("/")
    page.page.keyboard.type("14")
    page.page.keyboard.press("Enter")
    assert page.page.inner_text("#node-name") == "Router 14"
    page.page.keyboard.press("/")
    page.page.keyboard.type("99")
    page.page.keyboard.press("Enter")
    page.page.wait_for_selector("#toasts :text('no node 99')")
    assert page.page.inner_text("#node-name") == "Router 14"


def test_a_node_that_is_found_comes_into_view(page):
    for _ in range(12):
        page.page.click("#zoom-in")
    page.page.fill("#find", "17")
    page.page.press("#find", "Enter")
    box = page.page.locator("#map").bounding_box()
    assert box is not None
    page.wait_for(
        "17 is in view",
        lambda: (
            box["x"] < on_screen(page, *PLACES[17])[0] < box["x"] + box["width"]
            and box["y"] < on_screen(page, *PLACES[17])[1] < box["y"] + box["height"]
        ),
    )


# The map draws before the next frame.
DRAWN = "() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))"


def test_the_map_fits_again_when_a_drone_leaves_it_unless_the_user_has_moved_it(page):
    def scale() -> float:
        return float(page.page.get_attribute("#map-note", "data-scale"))

    before = scale()
    page.page.select_option("#speed", "10")
    page.page.click("#nodes tr[data-id='17']")
    page.page.fill("#fly-x", "60")
    page.answer_held("#held-now")
    page.page.press("#fly-x", "Enter")
    page.wait_for("a wider view", lambda: scale() < 0.8 * before)
    assert page.drawn("outside") == 0
    for _ in range(3):
        page.page.click("#zoom-in")
    page.page.evaluate(DRAWN)
    page.wait_for("marks of drones outside", lambda: page.drawn("outside") > 0)
    zoomed = scale()
    page.wait_for("17 arrived", lambda: abs(float(page.row(17, X)) - 60.0) < 0.2)
    assert scale() == zoomed


def test_a_drone_under_the_pointer_says_what_it_is_and_does(shared_page):
    shared_page.page.mouse.move(*on_screen(shared_page, *PLACES[14]))
    shared_page.page.mouse.move(*on_screen(shared_page, *PLACES[9]), steps=3)
    shared_page.wait_for(
        "a label", lambda: shared_page.page.inner_text("#hover") == "Router 9, connected"
    )
    shared_page.page.mouse.move(*on_screen(shared_page, 3.0, 3.0))
    shared_page.wait_for("no label", lambda: not shared_page.page.is_visible("#hover"))


def test_many_events_and_ids_are_only_a_few_tab_stops(page):
    page.page.check("#show-neighbours")
    page.page.click("#nodes tr[data-id='8']")
    page.wait_for("its neighbours", lambda: page.page.locator("#node-facts button").count() > 8)
    page.wait_for("their events", lambda: page.page.locator("#events button").count() > 50)
    stops = page.page.evaluate(
        "const visible = { visibilityProperty: true };"
        "[...document.querySelectorAll('button, input, select, [tabindex]')]"
        ".filter((e) => e.tabIndex >= 0 && e.checkVisibility(visible)).length"
    )
    assert stops < 50
    page.page.focus("#events")
    page.page.keyboard.press("ArrowDown")
    page.page.keyboard.press("ArrowDown")
    chosen = page.page.evaluate("document.activeElement.textContent")
    page.page.keyboard.press("Enter")
    assert page.page.inner_text("#node-name").split()[1] == chosen


def test_the_clock_is_not_announced_and_every_button_has_a_name_in_words(shared_page):
    assert shared_page.page.get_attribute("#clock", "role") == "timer"
    assert shared_page.page.locator("output").count() == 0
    for name in (
        "Zoom in",
        "Zoom out",
        "Light or dark theme",
        "List of keys",
        "Close",
        "Send drones to layout",
    ):
        assert shared_page.page.get_by_label(name, exact=True).count() == 1, name


DRAW_LOST = """async (count) => {
  const { drawMesh, readColours } = await import("/static/draw.js");
  const { Camera } = await import("/static/camera.js");
  const nodes = new Map();
  for (let id = 0; id < 254; id++)
    nodes.set(id, { id, role: 0, on: true, colour: "off", path: [],
      position: [id % 16, id / 16, 0], heading: [] });
  const lost = [];
  for (let a = 0; a < 254 && lost.length < count; a++)
    for (let b = a + 1; b < 254 && lost.length < count; b++) lost.push([a, b]);
  const context = document.createElement("canvas").getContext("2d");
  let alpha = null;
  const stroke = context.stroke.bind(context);
  context.stroke = () => {
    if (context.getLineDash().length) alpha ??= context.globalAlpha;
    stroke();
  };
  const mesh = { nodes, links: { known: [], lost, route: [], soon: [], relief: [] }, clock: {},
    obstacles: [], fence: [], trails: new Map(), selected: null, group: new Set() };
  const options = { known: true, ranges: false, cast: new Set(),
    covered: { top: 0, bottom: 0 } };
  const drawn = drawMesh(context, new Camera(), mesh, readColours(), options, []);
  return [drawn.lostLinks, alpha];
}"""


def test_lost_links_of_a_crowd_fade_and_only_the_shortest_are_drawn(shared_page):
    assert shared_page.page.evaluate(DRAW_LOST, 40) == [40, 1]
    drawn, alpha = shared_page.page.evaluate(DRAW_LOST, 20_000)
    assert drawn == 1500
    assert alpha == pytest.approx(0.25)


def test_the_whole_table_fits_beside_the_map_at_1400_pixels(start_console, visit):
    console = start_console("--routers", "253", "--gridsize", "16", "--spacing", "6", *FAST)
    page = visit(console.url, viewport={"width": 1400, "height": 880})
    page.wait_for_drones(254)
    wide, room = page.page.evaluate(
        "(({ scrollWidth, clientWidth }) => [scrollWidth, clientWidth])"
        "(document.querySelector('#nodes-card .scroll'))"
    )
    assert wide <= room


def test_charts_have_several_times_and_no_false_start(shared_page):
    shared_page.wait_for(
        "times below each chart",
        lambda: all(
            int(shared_page.page.get_attribute(f"#chart-{name}", "data-ticks") or 0) >= 2
            for name in ("share", "rate", "hops")
        ),
    )


def test_on_a_phone_the_selected_node_its_switch_and_its_close_button_stay_on_the_screen(
    start_console, visit
):
    page = visit(start_console(*FAST).url, viewport={"width": 390, "height": 780}, has_touch=True)
    page.wait_for_drones(len(PLACES))
    page.page.keyboard.press("n")
    page.page.keyboard.press("p")  # the gateway is off: every router gets lost
    page.page.select_option("#speed", "5")
    page.page.fill("#find", "17")
    page.page.press("#find", "Enter")
    page.wait_for(
        "17 is lost",
        lambda: page.page.inner_text("#node-condition") == "not connected to a gateway",
    )
    assert page.page.get_attribute("#node-condition", "data-severity") == "2"
    assert page.page.locator("#node-facts dt:text-is('Last gateway')").is_visible()
    fallback = page.page.locator("#node-facts div:has(dt:text-is('Fallback position')) dd")
    page.wait_for(
        "whose position, and how old",
        lambda: bool(re.fullmatch(r"node \d+’s, reported \d+ s ago", fallback.inner_text())),
    )
    for selector in ("#node-close", "#power", "#fly-form [type=submit]", "#remove"):
        box = page.page.locator(selector).bounding_box()
        assert box is not None
        assert box["x"] >= 0, selector
        assert box["x"] + box["width"] <= 390, selector
    top = page.page.locator("#map-top").bounding_box()
    card = page.page.locator("#map-card").bounding_box()
    assert top is not None
    assert card is not None
    for place in PLACES:
        x, y = on_screen(page, *place)
        assert card["x"] <= x <= card["x"] + card["width"], place
        assert top["y"] + top["height"] <= y <= card["y"] + card["height"], place


def test_the_chart_of_hops_has_a_gap_while_no_router_is_connected(page):
    page.wait_for("hops", lambda: page.page.inner_text("#hops-now") not in ("–", ""))
    page.page.click("#nodes tr[data-id='0']")
    page.page.click("#power")  # the gateway is off
    page.page.select_option("#speed", "10")
    page.wait_for("no share", lambda: page.page.inner_text("#share-now") == "0 %")
    page.wait_for("no hops", lambda: page.page.inner_text("#hops-now") == "–")


def test_drones_at_one_position_are_fanned_out_and_each_can_be_selected(start_console, visit):
    page = visit(start_console("--routers", "4", "--spacing", "0.05", *FAST).url)
    page.wait_for_drones(5)
    radius = float(page.page.get_attribute("#map-note", "data-radius"))
    distance = 1.15 * radius / math.sin(math.pi / 4)
    for number, node in enumerate((1, 2, 3, 4)):
        x, y = on_screen(page, 0.05 * number, 0.0)
        angle = math.pi / 2 - 2 * math.pi * number / 4
        page.page.mouse.click(x + distance * math.cos(angle), y - distance * math.sin(angle))
        assert page.page.inner_text("#node-name") == f"Router {node}"


DRAWING_ORDER = """async () => {
  const { drawingOrder } = await import("/static/draw.js");
  const nodes = new Map([[0, 1], [1, 0], [2, 0], [3, 0]].map(([id, role]) => [id, { id, role }]));
  return drawingOrder({ nodes, selected: 2 }).map((node) => node.id);
}"""


def test_gateways_are_drawn_above_routers_and_the_selected_node_above_all(shared_page):
    assert shared_page.page.evaluate(DRAWING_ORDER) == [1, 3, 0, 2]


def test_ids_of_three_digits_fit_into_their_dots(shared_page):
    widths = shared_page.page.evaluate(
        """async () => {
          const { idSize } = await import("/static/draw.js");
          const context = document.createElement("canvas").getContext("2d");
          return [8, 10, 13].map((radius) => {
            context.font = `600 ${idSize(248, radius)}px system-ui, sans-serif`;
            return context.measureText("248").width / (2 * radius);
          });
        }"""
    )
    assert max(widths) < 0.95


def test_beside_small_drones_there_are_the_ids_of_all_or_of_none(shared_page):
    sizes = shared_page.page.evaluate(
        """async () => {
          const { labelSize } = await import("/static/draw.js");
          const sizes = (radius) => [[7, 99], [7, 253]].map((ids) => labelSize(ids, radius));
          return [4.5, 6, 13].map(sizes);
        }"""
    )
    assert sizes[0][0] > 0  # 15 px from drone to drone
    assert sizes[0][1] == 0
    assert sizes[1][1] > 0  # 20 px: three digits, too
    assert sizes[2] == [10, 10]


GRID_CALLS = """() => new Promise((done) => {
  const calls = [];
  for (const name of ["stroke", "fillText"]) {
    const call = CanvasRenderingContext2D.prototype[name];
    CanvasRenderingContext2D.prototype[name] = function (...what) {
      if (this.canvas.id === "map" && (name === "stroke" || / m$/.test(what[0]))) calls.push(name);
      return call.call(this, ...what);
    };
  }
  document.querySelector("#zoom-in").click();
  requestAnimationFrame(() => requestAnimationFrame(() => done(calls)));
})"""


def test_no_line_of_the_grid_is_drawn_through_its_numbers(page):
    assert page.page.evaluate(GRID_CALLS)[:3] == ["stroke", "fillText", "fillText"]


YARD = """areas:
  - {name: yard, polygon: [[-5, -5], [40, -5], [40, 30], [-5, 30]], max_height: 30,
     holes: [[[0, 20], [4, 20], [4, 24], [0, 24]]]}
  - {name: tower, inclusion: false, center: [25, 12], radius: 5, min_height: 2, max_height: 20}
"""
FENCE_CALLS = """() => new Promise((done) => {
  const calls = [];
  const context = CanvasRenderingContext2D.prototype;
  for (const name of ["stroke", "fill", "fillText"]) {
    const call = context[name];
    context[name] = function (...what) {
      if (this.canvas.id === "map" && (what.length || this.getLineDash()[0] === 8))
        calls.push(what[0] ?? "dashes");
      return call.call(this, ...what);
    };
  }
  document.querySelector("#zoom-out").click();
  requestAnimationFrame(() => requestAnimationFrame(() => done(calls)));
})"""


def test_the_fence_is_drawn_with_its_names_and_heights(start_console, visit, tmp_path):
    (tmp_path / "yard.yaml").write_text(YARD)
    page = visit(start_console("--skip", "25", "--fence", str(tmp_path / "yard.yaml")).url)
    page.wait_for_drones(len(PLACES))
    calls = page.page.evaluate(FENCE_CALLS)
    first = calls.index("dashes")
    assert calls[first : first + 4] == [
        "dashes", "yard, to 30 m", "evenodd", "tower, from 2 m to 20 m"
    ]  # fmt: skip
    legend = page.page.inner_text("#map-card .legend")
    assert "stay inside" in legend
    assert "stay out" in legend


def test_a_relief_with_its_batteries_and_pads_is_told(start_console, visit):
    page = visit(start_console("--skip", "25", "--relief").url)
    page.wait_for_drones(len(PLACES))
    assert (page.row(1, BATTERY), page.row(2, BATTERY)) == ("24 % 0:50", "87 % 13:25")
    assert page.row(2, DOES).startswith("relieves 1; ")
    legend = page.page.inner_text("#map-card .legend")
    assert re.search(r"pad; filled: a crew is at work\s+relieves", legend)
    served = "the crew swaps its battery: 12 s left"
    for node, fact in ((1, "Relieved by\n2"), (2, "Relieves\n1"), (3, served)):
        page.page.click(f"#nodes tr[data-id='{node}']")
        page.wait_for(fact, lambda fact=fact: fact in page.page.inner_text("#node-facts"))


def test_an_area_that_is_drawn_is_kept_by_the_drones_and_goes_when_it_is_deleted(page):
    for _ in range(2):
        page.page.click("#zoom-out")
    page.page.wait_for_timeout(500)  # until that is drawn
    page.page.click("#fence")
    assert page.page.is_disabled("#fence-save")
    for corner in ((-4, 11), (2, 11), (2, 16), (-4, 16)):
        page.page.mouse.click(*on_screen(page, *corner))
    page.page.click("#fence-save")
    page.wait_for("why", lambda: page.page.inner_text("#fence-error") == "give the area a name")
    page.page.fill("#fence-name", "pond")
    page.page.fill("#fence-top", "5")
    page.page.click("#fence-save")
    page.wait_for("it is told", lambda: "fence of 1" in page.page.inner_text("#toasts"))
    page.wait_for("the legend", lambda: page.page.is_visible("#legend-outside"))
    assert page.page.is_hidden("#fence-form")
    why = "inside fence pond, which drones stay out of"  # drone 13 stands there
    page.wait_for("its alarm", lambda: why in page.page.inner_text("#alarms"))
    page.page.click("#nodes tr[data-id='17']")
    page.page.fill("#fly-x", "0")
    page.page.fill("#fly-y", "14")
    page.answer_held("#held-now")
    page.page.click("#fly-form button")
    page.wait_for("a refusal", lambda: why in page.page.inner_text("#toasts"))
    page.page.click("#fence")
    page.page.click("#fence-delete")
    page.page.click("#confirm [value=yes]")
    page.wait_for("no legend", lambda: page.page.is_hidden("#legend-outside"))
    assert page.page.is_hidden("#fence-areas")
    page.page.mouse.click(*on_screen(page, 20, 20))
    page.page.click("#add")  # one form at a time
    assert page.page.is_hidden("#fence-form")
    assert page.page.is_visible("#add-form")
    assert page.unexpected() == []


SHOWN_RATES = """async (whole) => {
  const { Charts } = await import("/static/charts.js");
  const { Mesh } = await import("/static/mesh.js");
  const mesh = new Mesh();
  const texts = [];
  const write = CanvasRenderingContext2D.prototype.fillText;
  CanvasRenderingContext2D.prototype.fillText = function (text, ...place) {
    if (this.canvas.id === "chart-rate") texts.push(text);
    return write.call(this, text, ...place);
  };
  new Charts(mesh);
  document.querySelector("#charts-whole").setAttribute("aria-pressed", whole);
  const samples = Array.from({ length: 300 }, (_, i) => ({
    stamp_s: i, routers_on: 1, routers_connected: 1, mean_hops: 1, most_hops: 1,
    messages: i < 20 ? 9000 * i : 180000 + 12 * i,
  }));
  texts.length = 0;
  mesh.apply({ clock: {}, samples });
  CanvasRenderingContext2D.prototype.fillText = write;
  return texts;
}"""


def test_a_chart_is_scaled_by_what_it_shows(page):
    assert "10k" not in page.page.evaluate(SHOWN_RATES, False)
    assert "10k" in page.page.evaluate(SHOWN_RATES, True)
