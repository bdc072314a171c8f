"""A node that cannot understand its neighbours names the key as the likely reason."""

from __future__ import annotations

import pytest
from seal_rig import KEY, OTHER_KEY

from drone_mesh.communication.data.outgoing import TO_GATEWAY
from drone_mesh.inprocess import Network


def pair(key_of_router, key_of_gateway=KEY):
    """A gateway and a router beside it, with these keys, after a minute."""
    network = Network(seed=1, key=lambda node: key_of_router if node else key_of_gateway)
    network.add_gateway(0, 0.0, 0.0)
    network.add_router(1, 6.0, 0.0)
    network.run_for(60.0)
    assert not network.connected(1)
    return network


OTHER = (
    "a neighbour, node {}, sends packets that this node's key does not open: "
    "another mesh or another key?"
)


@pytest.mark.parametrize(
    ("key", "node", "reason"),
    [
        (OTHER_KEY, 0, OTHER.format(1)),
        (OTHER_KEY, 1, OTHER.format(0)),
        (None, 0, "a neighbour, node 1, sends packets without a seal: it has no key"),
    ],
    ids=["other key", "other key, router", "no key, gateway"],
)
def test_a_message_that_finds_no_route_names_the_neighbour_with_another_key(key, node, reason):
    network, other = pair(key), 1 - node
    if node:
        to_gateway = network.send(node, TO_GATEWAY, b"x")
        assert to_gateway.reason == f"this node knows no gateway; {reason}"
    waiting = network.send(node, other, b"x")
    unreliable = network.send(node, other, b"x", reliable=False)
    network.run_for(1.0)
    assert (
        str(waiting)
        == f"message {1 + node} to node {other}: queued: no route to node {other}; {reason}"
    )
    assert unreliable.reason == f"no route to node {other}; {reason}"
    network.run_for(300.0)
    assert waiting.reason == f"no route to node {other} for 240 s; {reason}"


def test_a_node_without_a_key_in_a_mesh_with_one_says_so():
    network = pair(None)
    waiting = network.send(1, 0, b"x")
    network.run_for(10.0)
    reason = "a neighbour, node 0, has a mesh key and this node has none"
    assert str(waiting) == f"message 1 to node 0: sent: no acknowledgement yet; {reason}"
    assert network.send(1, TO_GATEWAY, b"x").reason == f"this node knows no gateway; {reason}"
    network.run_for(300.0)
    assert waiting.reason == f"no acknowledgement from node 0 for 240 s; {reason}"


def test_after_the_key_was_corrected_it_is_not_mentioned():
    keys = {0: KEY, 1: OTHER_KEY}
    network = Network(seed=1, key=keys.__getitem__)
    network.add_gateway(0, 0.0, 0.0)
    network.add_router(1, 6.0, 0.0)
    network.run_for(60.0)
    keys[1] = KEY
    network.restart(1)
    assert network.run_until(network.all_connected, within_s=30.0)
    network.run_for(61.0)
    ticket = network.send(0, 9, b"x")
    assert ticket.reason == "no route to node 9"


@pytest.mark.parametrize("routing", ["beacon", "child_table_tree"])
def test_a_router_without_the_key_does_not_believe_that_it_is_connected(routing):
    """It can read beacons, but nobody takes its packets."""
    network = Network(
        1,
        key=lambda node: None if node == 3 else KEY if node == 0 else KEY.for_node(node),
        routing=routing,
    )
    network.add_gateway(0, 0.0, 0.0)
    for node in (1, 2, 3):
        network.add_router(node, 6.0 * node, 0.0)
    believed = 0
    for _ in range(60):
        network.run_for(1.0)
        believed += network.nodes[3].component.get_connected_to_gateway()
    assert network.connected(2)
    assert believed <= 5  # until a neighbour has challenged it
