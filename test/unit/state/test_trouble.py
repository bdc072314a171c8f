"""What counts as trouble, and how a mesh is summed up."""

from __future__ import annotations

from drone_mesh.drone.roles import Role
from drone_mesh.state.condition import (
    Condition,
    Severity,
    all_connected,
    condition_of,
    find_trouble,
    summarise,
)
from drone_mesh.state.model import NodeStatus

GATEWAY = NodeStatus(0, Role.GATEWAY, connected=True, next_hop=0, route=bytes([0]))


def router(node: int, **changes: object) -> NodeStatus:
    fields = {"connected": True, "next_hop": 0, "route": bytes([node, 0]), **changes}
    return NodeStatus(node, **fields)  # type: ignore[arg-type]


def test_a_healthy_mesh_has_no_trouble():
    nodes = [GATEWAY, router(1), router(2)]
    troubles = find_trouble(nodes)
    assert troubles == []
    summary = summarise(nodes, troubles)
    assert (summary.severity, summary.text) == (Severity.OK, "2 of 2 routers connected")
    assert all_connected(troubles)


def test_a_router_without_a_gateway_is_an_error():
    flying = router(3, connected=False, path=(1.0, 2.0, 0.0))
    nodes = [GATEWAY, router(1), router(2, connected=False), flying]
    troubles = find_trouble(nodes)
    assert [(t.node, t.severity, t.text) for t in troubles] == [
        (2, Severity.ERROR, "not connected to a gateway"),
        (3, Severity.ERROR, "flying"),
    ]
    assert summarise(nodes, troubles).text == "1 of 3 routers connected"
    assert not all_connected(troubles)


def test_a_node_that_is_off_need_not_be_connected():
    nodes = [GATEWAY, router(1), router(2, on=False, connected=False)]
    troubles = find_trouble(nodes)
    assert [(t.node, t.severity) for t in troubles] == [(2, Severity.WARN)]
    assert summarise(nodes, troubles).text == "1 of 1 routers connected, 1 switched off"
    assert all_connected(troubles)


def test_a_node_of_a_silent_host_is_stale_whatever_it_reported_last():
    nodes = [GATEWAY, router(1, report_age=12.3)]
    troubles = find_trouble(nodes)
    assert [(t.node, t.severity, t.text) for t in troubles] == [
        (1, Severity.STALE, "no report for 12 s")
    ]
    assert summarise(nodes, troubles).text == "0 of 0 routers connected, 1 silent"
    assert not all_connected(troubles)


def test_a_route_that_breaks_off_is_a_warning():
    nodes = [GATEWAY, router(1, next_hop=2, route=bytes([1, 2])), router(2, next_hop=1)]
    nodes[2].route = bytes([2, 1])
    assert [t.text for t in find_trouble(nodes)] == [
        "its route breaks off: 1 > 2",
        "its route breaks off: 2 > 1",
    ]


def test_a_mesh_without_nodes_is_stale():
    assert summarise([], []).severity == Severity.STALE


def test_a_crashed_drone_is_a_warning_while_its_node_works_and_an_error_when_it_does_not():
    nodes = [GATEWAY, router(1, crashed=True), router(2, crashed=True, connected=False)]
    troubles = find_trouble(nodes)
    assert [(t.node, t.severity, t.text) for t in troubles] == [
        (1, Severity.WARN, "crashed"),
        (2, Severity.ERROR, "crashed, not connected to a gateway"),
    ]
    assert summarise(nodes, troubles).text == "1 of 2 routers connected, 2 crashed"
    assert condition_of(nodes[1]) is Condition.CRASHED


def test_another_radio_with_the_id_of_a_node_is_named_whether_the_node_is_connected_or_not():
    nodes = [GATEWAY, router(1, shares_id=True), router(2, shares_id=True, connected=False)]
    assert [(t.node, t.severity, t.text) for t in find_trouble(nodes)] == [
        (1, Severity.WARN, "another radio uses id 1"),
        (2, Severity.ERROR, "another radio uses id 2, not connected to a gateway"),
    ]


def test_a_battery_is_named_when_it_is_low_and_when_it_is_empty():
    low = router(1, battery=18.0, why_not_fly="battery at 18 %")
    empty = router(2, battery=0.0, on=False)
    assert [t.text for t in find_trouble([GATEWAY, low, empty])] == [
        "cannot fly: battery at 18 %",
        "battery empty",
    ]


def test_the_line_about_the_mesh_names_a_jammer():
    nodes = [NodeStatus(0, role=Role.GATEWAY, connected=True), NodeStatus(1, jammed=True)]
    text = "0 of 1 routers connected, radio channel jammed at 1"
    assert summarise(nodes, find_trouble(nodes)).text == text
