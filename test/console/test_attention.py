"""The page says what needs attention, to every window, at every width."""

from __future__ import annotations

import pytest
from test_page import PLACES

FAST = ("--skip", "25")


def test_alarms_last_until_they_are_over_and_acknowledged(page):
    page.page.select_option("#speed", "10")
    page.page.click("#nodes tr[data-id='0']")
    page.page.click("#power")  # without a gateway all are lost
    count = page.page.locator("#alarm-count")
    page.wait_for("17 alarms", lambda: count.inner_text() == "17 alarms")
    count.click()
    assert page.page.evaluate("document.activeElement.id") == "alarms"
    alarms = page.page.locator("#alarms li")
    assert alarms.count() == 1
    assert "1, 2, 3, 4, 5, 6, 7, 8 and 9 more lost the gateway" in alarms.inner_text()
    page.page.click("#power")
    page.wait_for("their end", lambda: "over" in alarms.last.inner_text())
    page.wait_for("all over", lambda: alarms.count() == 1 and "over" in alarms.inner_text())
    page.page.click("#alarms >> text=Acknowledge")
    page.wait_for("no alarm", lambda: not count.is_visible() and alarms.count() == 0)


MESH_ALARM = """async () => {
  const { Alarms } = await import("/static/alarms.js");
  const { Mesh } = await import("/static/mesh.js");
  const mesh = new Mesh();
  new Alarms(mesh, () => {}, () => {});
  const alarm = { text: "the radio channel is jammed", nodes: [], since: 61, over: false };
  mesh.apply({ clock: {}, alarms: [alarm] });
  const find = (what) => document.querySelector(what);
  const texts = ["#alarm-count", "#alarms li span"].map((what) => find(what).innerText);
  return [...texts, find("#alarms button").ariaLabel];
}"""


def test_an_alarm_of_the_whole_mesh_is_one_alarm_without_nodes(page):
    assert page.page.evaluate(MESH_ALARM) == [
        "1 alarm",
        "The mesh: the radio channel is jammed (since 61 s)",
        "Acknowledge: the mesh: the radio channel is jammed",
    ]


def test_what_many_nodes_do_at_once_is_one_sentence(page):
    row = page.page.locator("#events li:has-text('reached gateway 0')")
    page.wait_for("a sentence", lambda: row.count() == 1)
    assert "1, 2, 3, 4, 5, 6, 7, 8 and 9 more reached gateway 0" in row.inner_text()


def test_the_table_shows_only_problems_or_what_matches_until_one_goes_to_another_node(page):
    shown = page.page.locator("#nodes tbody tr:visible")
    page.page.click("#nodes tr[data-id='17']")
    page.page.click("#power")
    page.page.check("#only-problems")
    page.wait_for("one row", lambda: shown.count() == 1)
    assert page.page.inner_text("#shown") == "1 of 18"
    page.page.uncheck("#only-problems")
    page.page.fill("#filter", "17")
    assert shown.count() == 1
    page.page.fill("#find", "4")
    page.page.press("#find", "Enter")
    assert shown.count() == 18
    assert page.page.get_attribute("#nodes tr[data-id='4']", "aria-selected") == "true"


def test_another_window_is_told_what_was_ordered(start_console, visit):
    console = start_console(*FAST)
    page, other = visit(console.url), visit(console.url)
    for opened in (page, other):
        opened.wait_for_drones(len(PLACES))
        opened.undo_next()  # it notes the texts
    page.page.keyboard.press("n")
    page.page.keyboard.press("p")
    other.wait_for_toasts("another window: node 0 is off", "another window: node 0 is on")
    page.wait_for_toasts("node 0 is off", "node 0 is on")


@pytest.mark.parametrize("key", ["Escape", "z", "Enter"])
def test_one_key_undoes_a_typed_order_and_the_focus_returns(page, key):
    page.page.click("#nodes tr[data-id='13']")
    page.page.fill("#fly-x", "-3")
    page.page.press("#fly-x", "Enter")
    page.wait_for("a held order", lambda: page.page.is_visible("#held"))
    page.page.keyboard.press(key)
    page.wait_for("no held order", lambda: not page.page.is_visible("#held"))
    assert page.page.inner_text(".toast") == "not sent: Drone 13 will leave to -3, 12"
    assert page.page.evaluate("document.activeElement.id") == "fly-x"


def test_the_focus_goes_to_the_map_when_what_had_it_disappears(page):
    page.page.click("#nodes tr[data-id='13']")
    page.page.focus("#node-close")
    page.page.keyboard.press("Enter")
    page.wait_for(
        "the focus", lambda: page.page.evaluate("document.activeElement.id") == "map", 5.0
    )


ORDER_SPEEDS = """() => {
  window.shown = [];
  new MutationObserver(() =>
    window.shown.push([...document.querySelectorAll(".toast")].map((one) => one.innerText)),
  ).observe(document.getElementById("toasts"), { childList: true });
  for (const factor of ["2", "5", "10"]) {
    const speed = document.getElementById("speed");
    speed.value = factor;
    speed.dispatchEvent(new Event("change"));
  }
}"""


def test_at_most_two_toasts_are_shown(page):
    page.page.evaluate(ORDER_SPEEDS)
    page.page.wait_for_selector("#toasts :text('speed 10')")
    shown = page.page.evaluate("window.shown")
    with_last = next(texts for texts in shown if any("speed 10" in text for text in texts))
    assert (len(with_last), max(map(len, shown))) == (2, 2)


OVERLAPS = """() => {
  const shown = [...document.querySelectorAll("button, select, input")].filter(
    (one) => one.checkVisibility() && !one.closest(".map-tools, .scroll, main, #timeline"),
  );
  const boxes = shown.map((one) => [one.id || one.textContent, one.getBoundingClientRect()]);
  const found = [];
  boxes.forEach(([a, p], i) => boxes.slice(i + 1).forEach(([b, q]) => {
    const across = p.right - 1 > q.left && q.right - 1 > p.left;
    if (across && p.bottom - 1 > q.top && q.bottom - 1 > p.top) found.push(`${a} and ${b}`);
  }));
  return found;
}"""


@pytest.mark.parametrize("width", [320, 260])
def test_on_a_narrow_screen_nothing_sticks_out_or_overlaps(start_console, visit, width):
    page = visit(start_console(*FAST).url, viewport={"width": width, "height": 640})
    page.wait_for_drones(len(PLACES))
    page.page.click("nav button[data-tab=nodes]")
    page.page.click("#nodes tr[data-id='2']")
    page.page.click("#power")
    page.page.wait_for_selector(".toast")
    for tab in ("nodes", "events", "charts", "map"):
        page.page.click(f"nav button[data-tab={tab}]")
        assert page.page.evaluate("document.documentElement.scrollWidth") <= width
        assert page.page.evaluate("document.querySelector('main').scrollWidth") <= width
        assert page.page.evaluate(OVERLAPS) == []
    page.page.click("nav button[data-tab=nodes]")
    table = page.page.locator("#nodes-card .scroll")
    longest = "(box) => { box.querySelector('.condition').textContent = 'disconnected' }"
    table.evaluate(longest)
    assert table.evaluate("(box) => box.scrollWidth - box.clientWidth") == 0
