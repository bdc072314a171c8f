"""Routes put together from next hops."""

from __future__ import annotations

from drone_mesh.communication.interfaces import NO_ROUTE
from drone_mesh.drone.roles import Role
from drone_mesh.state.links import reaches_gateway, route_to_gateway
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
