"""Links by what they are used for."""

from __future__ import annotations

from drone_mesh.drone.roles import Role
from drone_mesh.state.links import JUST_LOST_S, LostLinks, known_links, route_links, shortest
from drone_mesh.state.model import NodeStatus


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
