"""Reliable messages around a relay that sends beacons and acknowledges, and forwards nothing."""

from __future__ import annotations

import pytest
from proofs.stranger import Hole, Tap

from drone_mesh.communication.data.outgoing import TO_GATEWAY, TicketState
from drone_mesh.communication.interfaces import BROADCAST
from drone_mesh.communication.seals.keys import MeshKey
from drone_mesh.communication.wire.messages import header
from drone_mesh.inprocess import Network

KEY = MeshKey(b"the key of a lab")


class Sink(Tap):
    """A node that drops all packets for other nodes: it is broken, or swallows them."""

    def on_msg(self, payload, now_s):
        _creator, _from, _kind, _to, forward = header(payload)
        if forward in (self.get_node_id(), BROADCAST):
            self.tapped.on_msg(payload, now_s)


def behind_a(sink, key=None):
    """A grid of 25 nodes, and the routers whose packets go through its busiest relay, which is one.

    It is not the only way: each of its neighbours has others.
    """
    network = Network(seed=1, routing="beacon", key=key)
    network.add_fleet(gateways=1, routers=24, gridsize=5, spacing=6.0)
    assert network.run_until(network.all_connected, within_s=30.0)
    network.run_for(20.0)
    paths = [path for path in map(network.path_to_gateway, network.nodes) if len(path) > 2]
    relays = [path[-2] for path in paths]
    relay = max(relays, key=relays.count)
    network.nodes[relay].receiver = sink(network, relay, [])
    return network, [path[0] for path in paths if path[-2] == relay]


def deliver(network, routers, within_s):
    tickets = [network.send(router, TO_GATEWAY, b"around") for router in routers]
    network.run_for(within_s)
    return sum(ticket.state is TicketState.DELIVERED for ticket in tickets) / len(tickets)


@pytest.mark.parametrize(
    ("sink", "key"),
    [(Sink, None), (Hole, KEY)],
    ids=["without a key", "a captured node that forwards heartbeats only"],
)
def test_reliable_messages_find_a_way_around_it_and_then_keep_it(sink, key):
    """None arrived: questions about them went another way, and they themselves did not."""
    network, routers = behind_a(sink, key)
    assert len(routers) >= 8
    assert deliver(network, routers, within_s=60.0) >= 0.9
    deliver(network, routers, within_s=20.0)
    assert deliver(network, routers, within_s=5.0) >= 0.8
