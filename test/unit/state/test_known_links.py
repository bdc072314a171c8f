"""Routes put together from next hops, links by their use, and links that will soon break."""

from __future__ import annotations

import math

import pytest

from drone_mesh.communication.interfaces import NO_ROUTE
from drone_mesh.drone.roles import Role
from drone_mesh.state.links import (
    JUST_LOST_S,
    LinkForecast,
    LostLinks,
    known_links,
    link_expires_s,
    reaches_gateway,
    route_links,
    route_to_gateway,
    shortest,
)
from drone_mesh.state.model import NodeStatus


def mesh(*next_hops: tuple[int, int], off: tuple[int, ...] = ()) -> dict[int, NodeStatus]:
    """A gateway 0, and routers with these (id, next hop)."""
    nodes = {0: NodeStatus(0, Role.GATEWAY, next_hop=0)}
    for node, next_hop in next_hops:
        nodes[node] = NodeStatus(node, next_hop=next_hop)
    for node in off:
        nodes[node].on = False
    return nodes


def test_a_route_names_each_hop_from_the_node_to_the_gateway():
    nodes = mesh((1, 0), (2, 1), (3, 2))
    assert route_to_gateway(3, nodes) == bytes([3, 2, 1, 0])
    assert reaches_gateway(bytes([3, 2, 1, 0]), nodes)


def test_a_gateway_is_its_own_route():
    assert route_to_gateway(0, mesh()) == bytes([0])


def test_a_node_without_a_next_hop_has_no_route():
    assert route_to_gateway(1, mesh((1, NO_ROUTE))) == b""


def test_a_route_that_goes_round_ends_before_it_repeats_itself():
    nodes = mesh((1, 2), (2, 3), (3, 1))
    assert route_to_gateway(1, nodes) == bytes([1, 2, 3])
    assert not reaches_gateway(bytes([1, 2, 3]), nodes)


def test_a_route_ends_at_a_node_that_is_off():
    nodes = mesh((1, 0), (2, 1), (3, 2), off=(1,))
    assert route_to_gateway(3, nodes) == bytes([3, 2, 1])
    assert not reaches_gateway(bytes([3, 2, 1]), nodes)


def test_a_node_that_is_off_has_no_route():
    assert route_to_gateway(2, mesh((1, 0), (2, 1), off=(2,))) == b""


def test_a_route_to_a_gateway_that_is_off_does_not_reach_it():
    nodes = mesh((1, 0), off=(0,))
    assert not reaches_gateway(route_to_gateway(1, nodes), nodes)


def test_a_route_ends_where_the_next_node_is_not_reported():
    assert route_to_gateway(2, mesh((2, 9))) == b""
    assert route_to_gateway(3, mesh((2, 9), (3, 2))) == bytes([3, 2])


def line(*xs: float) -> list[NodeStatus]:
    """A gateway 0 and routers at these places, each with the next one as its neighbour."""
    nodes = []
    for node, x in enumerate(xs):
        near = [other for other in (node - 1, node + 1) if 0 <= other < len(xs)]
        role = Role.ROUTER if node else Role.GATEWAY
        nodes.append(
            NodeStatus(
                node,
                role,
                connected=True,
                next_hop=max(0, node - 1),
                neighbours=bytes(near),
                position=(x, 0.0, 0.0),
            )  # fmt: skip
        )
    return nodes


def test_a_link_that_one_side_knows_is_known():
    nodes = line(0.0, 5.0)
    nodes[0].neighbours = b""
    assert known_links(nodes) == {(0, 1)}


def test_there_is_no_link_to_a_node_that_is_off():
    nodes = line(0.0, 5.0, 10.0)
    nodes[1].on = False
    assert known_links(nodes) == set()
    assert route_links(nodes) == set()


def test_route_links_are_the_next_hops_of_connected_routers():
    nodes = line(0.0, 5.0, 10.0)
    assert route_links(nodes) == {(0, 1), (1, 2)}
    nodes[2].connected = False
    assert route_links(nodes) == {(0, 1)}


def test_of_too_many_links_the_shortest_stay():
    nodes = line(0.0, 5.0, 7.0, 20.0)
    assert shortest(known_links(nodes), nodes, most=2) == [(1, 2), (0, 1)]


def test_a_link_to_an_unknown_position_is_not_drawn():
    nodes = line(0.0, 5.0)
    nodes[1].position = (float("nan"),) * 3
    assert shortest(known_links(nodes), nodes, most=9) == []


def test_a_lost_link_is_remembered_for_a_while():
    lost = LostLinks()
    assert lost.update({(0, 1), (1, 2)}, wall_s=0.0) == []
    assert lost.update({(0, 1)}, wall_s=1.0) == [(1, 2)]
    assert lost.update({(0, 1)}, wall_s=0.9 + JUST_LOST_S) == [(1, 2)]
    assert lost.update({(0, 1)}, wall_s=1.0 + JUST_LOST_S) == []
    assert lost.update(set(), wall_s=20.0) == [(0, 1)]
    assert lost.update({(0, 1)}, wall_s=21.0) == []  # it came back


@pytest.mark.parametrize(
    ("away", "drift", "expires_s"),
    [
        ((4.0, 0.0, 0.0), (1.0, 0.0, 0.0), 5.0),
        ((-4.0, 0.0, 0.0), (1.0, 0.0, 0.0), 13.0),  # it comes nearer first
        ((0.0, 0.0, 0.0), (0.0, 3.0, 0.0), 3.0),
        ((0.0, 5.4, 7.2), (0.0, 1.0, 0.0), 0.0),  # at the edge
        ((3.0, 0.0, 0.0), (0.0, 0.0, 0.0), math.inf),
        ((10.0, 0.0, 0.0), (-1.0, 0.0, 0.0), 0.0),  # out of range already
    ],
)
def test_a_link_expires_when_the_distance_reaches_the_range(away, drift, expires_s):
    assert link_expires_s(away, drift, 9.0) == pytest.approx(expires_s)


def forecast(*positions_of_1):
    """What is forecast for node 0, which stands at the origin, and node 1, one second apart."""
    watch, found = LinkForecast(), []
    for now_s, x in enumerate(positions_of_1):
        nodes = [NodeStatus(0, position=(0.0, 0.0, 0.0)), NodeStatus(1, position=(x, 0.0, 0.0))]
        found.append(watch.update([(0, 1)], nodes, float(now_s), 9.0))
    return found


def test_a_link_whose_ends_fly_apart_is_forecast_before_it_breaks():
    assert forecast(1.0, 2.0, 3.0, 4.0, 5.0) == [[], [], [], [], [(0, 1)]]


def test_a_link_of_standing_or_approaching_drones_is_not_forecast():
    assert not any(forecast(8.5, 8.5, 8.5))
    assert not any(forecast(8.5, 7.5, 6.5))


def test_nothing_is_forecast_after_a_jump_in_time_or_without_positions():
    watch = LinkForecast()
    for now_s, x in ((0.0, 1.0), (1.0, 3.0), (500.0, 8.0), (3.0, 8.9)):
        nodes = [NodeStatus(0, position=(0.0, 0.0, 0.0)), NodeStatus(1, position=(x, 0.0, 0.0))]
        found = watch.update([(0, 1)], nodes, now_s, 9.0)
    assert found == []
    assert watch.update([(0, 1)], [NodeStatus(0), NodeStatus(1)], 4.0, 9.0) == []
