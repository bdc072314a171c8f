"""A gateway reports the outcome of its orders over HTTP."""

from __future__ import annotations


def test_an_order_is_followed_to_its_arrival_where_its_location_header_points(make_mesh):
    mesh = make_mesh()
    sent = mesh.client.post("/DroneMovement/3/2.5/17.5/4")
    where = sent.headers["Location"]
    asked = mesh.client.get(where).json()
    assert asked["id"] == int(where.rpartition("/")[2])
    assert (asked["drone"], asked["state"], asked["reason"]) == (3, "sent", "")
    assert (asked["latitude"], asked["longitude"], asked["height"]) == (2.5, 17.5, 4)
    mesh.run_for(20.0)
    assert [(order.drone, order.state.value) for order in mesh.gateway.get_orders()] == [
        (3, "arrived")
    ]


def test_an_order_without_a_route_is_in_the_list_with_that_state(make_mesh):
    mesh = make_mesh()
    assert mesh.client.post("/DroneMovement/99/0/50/0").status_code == 503
    answer = mesh.client.get("/orders").json()
    assert answer["gateway"] == 0
    assert [(order["drone"], order["state"]) for order in answer["orders"]] == [(99, "no route")]


def test_an_unknown_order_is_answered_404_with_the_reason(mesh):
    answer = mesh.client.get("/orders/65535")
    assert answer.status_code == 404
    assert answer.json() == {"detail": "unknown order 65535: the gateway keeps only the latest"}
