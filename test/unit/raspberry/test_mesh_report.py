"""What a gateway knows of its mesh, and how the console's page shows it."""

from __future__ import annotations

import json

import pytest

from drone_mesh.communication.events.observer import MeshEvent, MeshEventKind
from drone_mesh.communication.timing import MeshTiming
from drone_mesh.console.gateway_client import events_of, real_mesh
from drone_mesh.drone.fence import Fence, Zone
from drone_mesh.drone.geodesy import Origin
from drone_mesh.drone.location import Location
from drone_mesh.drone.roles import Role
from drone_mesh.inprocess import Network
from drone_mesh.raspberry.node_events import EventHistory
from drone_mesh.raspberry.node_reports import mesh_report
from drone_mesh.state.condition import Condition, condition_of
from drone_mesh.state.observation import describe_fence

ORIGIN = Origin(52.0907, 5.1214, 3.0)


def answer(network, history=None):
    """GET /mesh of gateway 0."""
    node, now_s = network.nodes[0], network.clock.now_s
    report = mesh_report(node.component, node.drone, True, ORIGIN, now_s)
    events = history.since(0, 0.0) if history else []
    return json.loads(json.dumps({**report, "uptime_s": now_s, "events": events}))


@pytest.fixture
def network():
    """Gateway 0, and the routers 1 and 2 in a line; 2 stands on the ground."""
    network = Network(seed=1, timing=MeshTiming(report_period_s=30.0))
    network.add_gateway(0, 0.0, 0.0)
    network.add_router(1, 6.0, 1.0)
    network.add_router(2, 12.0, 1.0, why_not_fly="it stands on the ground")
    network.run_for(65.0)
    return network


def test_a_gateway_lists_what_its_nodes_reported_in_metres_and_in_degrees(network):
    gateway, one, two = answer(network)["nodes"]
    assert (gateway["role"], gateway["hops"], gateway["neighbours"]) == ("gateway", 0, [1])
    assert (one["hops"], one["next_hop"], one["neighbour_count"]) == (1, 0, 2)
    assert (two["hops"], two["next_hop"], two["neighbour_count"]) == (2, 1, 1)
    assert two["place"] == [1.0, 12.0, 0.0]
    assert two["earth"] == pytest.approx(
        [52.0907 + 1 / 111_260, 5.1214 + 12 / 68_560, 3.0], abs=1e-6
    )
    assert (one["why_not_fly"], two["why_not_fly"]) == ("", "it stands on the ground")
    assert two["heard_s_ago"] < 35.0


def test_the_page_shows_routes_places_and_why_a_drone_cannot_fly(network):
    mesh, more = real_mesh(answer(network))
    gateway, one, two = mesh.nodes
    assert (gateway.role, one.role) == (Role.GATEWAY, Role.ROUTER)
    assert [condition_of(node) for node in mesh.nodes] == [Condition.CONNECTED] * 3
    assert list(two.route) == [2, 1, 0]
    assert tuple(two.position) == (12.0, 1.0, 0.0)
    assert more[1]["drone"] == "can fly"
    assert (more[2]["drone"], two.why_not_fly) == ("", "it stands on the ground")
    assert more[2]["neighbours"] == 1
    assert more[2]["total_messages"] is None
    assert more[2]["earth"][2] == 3.0


def test_the_page_shows_the_fence_of_the_gateway(network):
    yard = Zone("yard", (((0, 0), (9, 0), (9, 9)), ((1, 1), (2, 1), (2, 2))), highest_m=30.0)
    network.nodes[0].drone.fence = fence = Fence.of([yard], [])
    assert real_mesh(answer(network))[0].fence == describe_fence(fence)


def test_a_node_that_falls_silent_is_shown_as_silent(network):
    network.power(2, False)
    network.run_for(120.0)
    mesh, _more = real_mesh(answer(network))
    assert condition_of(mesh.nodes[2]) is Condition.SILENT
    assert not mesh.nodes[2].connected


def test_without_reports_the_nodes_that_a_gateway_knows_are_shown():
    network = Network(seed=1)
    network.add_gateway(0, 0.0, 0.0)
    network.add_router(1, 6.0, 0.0)
    network.run_for(25.0)
    mesh, more = real_mesh(answer(network))
    assert mesh.nodes[1].connected
    assert more[1]["drone"] == "has not reported yet"
    assert more[1]["earth"] is None


def test_events_are_kept_with_numbers_and_times_since_the_start(network):
    history = EventHistory()
    for event in network.events[:3]:
        history.observe(event)
    assert [event["number"] for event in history.since(1, 0.0)] == [2, 3]
    first = events_of({"events": history.since(0, 0.0)})[0]
    assert (first.kind, first.node) == ("started", network.events[0].node)


def test_an_event_about_an_order_keeps_its_number_place_and_reason(caplog):
    caplog.set_level("INFO")
    place = Location(2.675, 1.125, 3.0)
    history = EventHistory()
    history.observe(MeshEvent(MeshEventKind.ORDER_REPLACED, 0, 1.0, 4, "by order 8", 7, place))
    kept = json.loads(json.dumps(history.since(0, 0.0)))
    [event] = events_of({"events": kept})
    assert (event.order, event.place, event.detail) == (7, place, "by order 8")
    said = "order 7 to x 1.12 m, y 2.67 m, z 3 m: by order 8"
    assert f"order replaced: node 4 ({said})" in caplog.text


def test_an_event_in_a_record_of_an_older_gateway_is_about_no_known_order():
    text = "order 7 to x 1.00 m, y 2.00 m, z 3 m"
    old = {"t": 1.0, "node": 0, "kind": "order sent", "peers": [4], "detail": text}
    [event] = events_of({"events": [old]})
    assert (event.order, event.place, event.explanation()) == (0, None, text)
