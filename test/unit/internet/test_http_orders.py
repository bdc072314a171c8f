"""What a gateway does and answers when it is asked over HTTP."""

from __future__ import annotations

import logging
import re

import pytest

from drone_mesh.internet import api


def test_ready_names_the_gateway(mesh):
    answer = mesh.client.get("/ready")
    assert (answer.status_code, answer.json()) == (200, {"ready": True, "gateway": 0})


def test_an_order_flies_a_drone_that_is_three_hops_away(make_mesh):
    mesh = make_mesh()
    answer = mesh.client.post("/DroneMovement/3/2.5/17.5/4")
    assert answer.status_code == 200
    assert answer.json() == {"drone": 3, "latitude": 2.5, "longitude": 17.5, "height": 4}
    mesh.run_for(20.0)
    assert mesh.network.location(3) == pytest.approx((2.5, 17.5, 4.0))


def test_an_order_for_a_drone_without_a_route_is_answered_503_with_the_reason(mesh):
    sent = mesh.sent()
    answer = mesh.client.post("/DroneMovement/99/2.5/17.5/4")
    assert answer.status_code == 503
    reason = "the gateway has no route to drone 99: the order was not sent"
    assert answer.json() == {"detail": reason}
    assert mesh.sent() == sent


@pytest.mark.parametrize(
    "address",
    ["/DroneMovement/1_0/1/1/0", "/DroneMovement/1/1_0/1/0", "/DroneMovement/1/1/1/1_0",
     "/DroneMovement/1/1/1/ 1", "/DroneMovement/+1/1/1/1", "/DroneMovement/1/nan/1/0"],
)  # fmt: skip
def test_only_numbers_in_decimal_digits_are_taken(mesh, address):
    sent = mesh.sent()
    answer = mesh.client.post(address)
    assert answer.status_code == 422
    assert "decimal digits" in answer.json()["detail"]
    assert mesh.client.get("/orders/1_0").status_code == 422
    assert mesh.sent() == sent


def test_more_orders_than_a_mesh_can_carry_are_not_sent(make_mesh, monkeypatch, caplog):
    monkeypatch.setattr(api, "MOST_ORDERS_AT_ONCE", 3)
    monkeypatch.setattr(api, "ORDER_PERIOD_S", 1000.0)
    caplog.set_level(logging.INFO)
    mesh = make_mesh()
    answers = [mesh.client.post("/DroneMovement/1/1/1/0") for _ in range(10)]
    statuses = [answer.status_code for answer in answers]
    assert statuses == [200] * 3 + [429] * 7
    assert answers[-1].json() == {"detail": "more than 0.001 orders a second: not sent"}
    assert answers[-1].headers["Retry-After"] == "1"
    assert len([line for line in caplog.messages if "order sent" in line]) == 1


def test_an_order_for_the_gateway_itself_flies_its_own_drone(make_mesh):
    mesh = make_mesh()
    assert mesh.client.post("/DroneMovement/0/1/0/2").status_code == 200
    mesh.run_for(20.0)
    assert mesh.network.location(0) == pytest.approx((1.0, 0.0, 2.0))


def test_nodes_lists_routes_hops_and_when_each_was_heard(mesh):
    answer = mesh.client.get("/nodes").json()
    assert answer["gateway"] == 0
    seen = {node["id"]: (node["next_hop"], node["hops"]) for node in answer["nodes"]}
    assert seen == {1: (1, 1), 2: (1, 2), 3: (1, 3)}
    assert all(0 <= node["heard_s_ago"] <= 12.0 for node in answer["nodes"])


def test_nodes_shows_that_a_route_is_gone_and_which_nodes_were_heard(make_mesh):
    def switch_off_the_first_relay(network):
        network.power(1, False)
        network.run_for(25.0)

    nodes = make_mesh(before=switch_off_the_first_relay).client.get("/nodes").json()["nodes"]
    assert [(node["id"], node["next_hop"]) for node in nodes] == [(1, None), (2, None), (3, None)]
    assert all(node["heard_s_ago"] > 20.0 for node in nodes)


@pytest.mark.parametrize(
    ("target", "reason"),
    [
        ("/DroneMovement/254/0/0/0", "id: .*less than or equal to 253"),
        ("/DroneMovement/-1/0/0/0", "id: .*greater than or equal to 0"),
        ("/DroneMovement/1.5/0/0/0", "id: .*must be a whole number"),
        ("/DroneMovement/1/inf/0/0", "latitude: .*must be a number"),
        ("/DroneMovement/1/5000.5/0/0", "latitude: .*less than or equal to 5000"),
        ("/DroneMovement/1/0/-5001/0", "longitude: .*greater than or equal to -5000"),
        ("/DroneMovement/1/0/0/501", "height: .*less than or equal to 500"),
        ("/DroneMovement/1/0/0/" + "9" * 500, "height: "),
        ("/DroneMovement/1/0/0/%ff%fe", "height: "),
    ],
)
def test_an_invalid_drone_or_place_is_answered_422_and_changes_nothing(mesh, target, reason):
    sent = mesh.sent()
    answer = mesh.client.post(target)
    assert answer.status_code == 422
    assert re.search(reason, answer.json()["detail"])
    assert mesh.sent() == sent


def test_each_number_that_is_wrong_is_named(mesh):
    detail = mesh.client.post("/DroneMovement/300/nan/0/x").json()["detail"]
    assert [part.split(":")[0] for part in detail.split("; ")] == ["id", "latitude", "height"]


@pytest.mark.parametrize(
    ("method", "target", "status"),
    [
        ("GET", "/", 404),
        ("POST", "/DroneMovement/1/2/3/4/5", 404),
        ("POST", "/DroneMovement/1/2/3/4/", 404),
        ("GET", "/static-offline-docs/%2e%2e/core.py", 404),
        ("GET", "/DroneMovement/1/2/3/4", 405),
        ("DELETE", "/nodes", 405),
    ],
)
def test_what_is_not_offered_is_refused_with_a_reason(mesh, method, target, status):
    sent = mesh.sent()
    answer = mesh.client.request(method, target)
    assert answer.status_code == status
    assert answer.json()["detail"]
    assert mesh.sent() == sent
