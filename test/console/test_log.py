"""The log of events: what happened to whom, in its order, with the time of each."""

from __future__ import annotations

import pytest

APPLY = """async (events) => {
  const { EventLog } = await import("/static/log.js");
  const { Mesh } = await import("/static/mesh.js");
  const mesh = new Mesh();
  const list = document.createElement("ol");
  document.body.append(list);
  new EventLog(mesh, list, () => true);
  for (const [t, node, kind, peers, detail] of events) {
    const event = { t, node, kind, peers: peers ?? [], detail: detail ?? "" };
    mesh.apply({ clock: {}, events: [event] });
  }
  list.querySelector(".when")?.click();
  const parts = (row) => [...row.querySelectorAll(":scope > :not(p), :scope > p > span")];
  return [...list.children].map((row) => parts(row).map((part) => part.innerText).join(" "));
}"""


@pytest.fixture
def log(shared_page):
    return lambda *events: shared_page.page.evaluate(APPLY, events)


def test_nothing_joins_a_sentence_from_before_the_opposite_happened(log):
    rows = log((1.0, 3, "power off"), (2.0, 3, "power on"), (3.0, 3, "power off"))
    assert rows == [
        "3.0 s 3 was switched off",
        "2.0 s 3 was switched on",
        "1.0 s 3 was switched off",
    ]


def test_a_sentence_of_several_nodes_says_from_when_to_when_and_a_click_unfolds_it(log):
    rows = log(*((t, node, "disconnected", [0]) for t, node in ((410.31, 2), (414.9, 4), (412, 3))))
    assert rows == ["410.3 to 414.9 s 2, 3, 4 lost gateway 0 2 410.3 s 3 412.0 s 4 414.9 s"]


@pytest.mark.parametrize(
    ("nodes", "kind", "said"),
    [
        ((5,), "battery low", "1.0 s 5 has a low battery"),
        ((5, 6), "battery low", "1.0 s 5, 6 have a low battery"),
        ((5, 6), "power off", "1.0 s 5, 6 were switched off"),
        ((5, 6), "emergency", "1.0 s 5, 6 begin a repair"),
    ],
)
def test_one_node_is_and_several_are(log, nodes, kind, said):
    assert log(*((1.0, node, kind) for node in nodes))[0].startswith(said)


def test_orders_to_several_drones_are_orders(log):
    rows = log((1.0, 0, "order sent", [4]), (1.5, 0, "order sent", [5]))
    assert rows[0].startswith("1.0 to 1.5 s 0 sent orders to 4, 5")
    assert log((1.0, 0, "order sent", [4])) == ["1.0 s 0 sent an order to 4"]


def test_a_flight_back_to_its_own_place_is_a_return(log):
    assert log((1.0, 2, "flight decided", [2])) == ["1.0 s 2 returns to where it was"]
    assert log((1.0, 3, "flight decided", [2]))[0].startswith("1.0 s 3 flies to the place of 2")


def test_the_last_flight_of_a_drone_without_a_mesh_is_no_repair(log):
    why = "flies home: no gateway for 120 s"
    rows = log(*((1.0, node, "flight decided", [], why) for node in (2, 3)))
    assert rows[0].startswith(f"1.0 s 2, 3 leave the lost mesh ({why})")
