"""A router's key does not make a gateway, whatever technique decides about gateways."""

from __future__ import annotations

import pytest

from drone_mesh.communication.node.node_configuration import ROUTING_TECHNIQUES
from drone_mesh.communication.seals.keys import MeshKey
from drone_mesh.inprocess import Network

KEY = MeshKey(bytes(range(16)))
CAPTURED = 9


@pytest.mark.parametrize("posed_first", [False, True])
@pytest.mark.parametrize("routing", sorted(ROUTING_TECHNIQUES))
def test_no_router_prefers_a_gateway_with_the_keys_of_a_router(routing, posed_first):
    network = Network(seed=1, routing=routing, key=lambda node: KEY.for_node(node) if node else KEY)
    network.add_gateway(0, 0.0, 0.0, start_s=90.0 if posed_first else 0.0)
    for router in range(1, 6):
        network.add_router(router, 6.0 * router, 0.0, why_not_fly="it is tied")
    network.add_gateway(CAPTURED, 36.0, 0.0, start_s=0.0 if posed_first else 60.0)
    network.run_for(240.0)
    for _ in range(6):
        network.run_for(10.0)
        nodes = [network.nodes[router].component for router in range(1, 6)]
        assert [node.get_preferred_gateway() for node in nodes] == [0] * 5
    network.order(5, 30.0, 1.0)
    network.send(4, 0, b"to the gateway")
    network.run_for(10.0)
    (order,) = network.nodes[0].component.get_orders()
    assert order.reason == "drone 5 cannot fly: it is tied"  # the order and the answer have arrived
    assert [message.payload for message in network.received[0]] == [b"to the gateway"]
