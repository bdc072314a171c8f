"""On a shared channel neighbours know where a router flies before it takes off."""

from __future__ import annotations

import pytest
from scenarios import placed

from drone_mesh.communication.events.observer import MeshEventKind
from drone_mesh.communication.seals.keys import MeshKey
from drone_mesh.communication.wire import messages
from drone_mesh.communication.wire.packet_types import MessageType

PLACES = [(0, 0), (6, 0), (12, 0), (6, 6), (12, 6), (18, 3)]


@pytest.mark.parametrize("key", [None, MeshKey(b"the key of a lab")], ids=["no key", "key"])
def test_neighbours_are_told_one_by_one_if_they_hear_no_broadcast(key):
    """Broadcasts collide, and nobody repeats them; with a key each is sealed for all."""
    network = placed(PLACES, seed=3, radio="shared", key=key)
    assert network.run_until(network.all_connected, within_s=120.0)
    network.run_for(60.0)
    antenna = network.nodes[1].antenna
    broadcast = antenna.broadcast_message

    def lose_places(payload):
        if messages.type_of(payload) != MessageType.LOCATION:
            broadcast(payload)

    antenna.broadcast_message = lose_places
    network.order(1, -30.0, 0.0)
    ordered_s = network.now_s()
    drone = network.nodes[1].drone
    assert network.run_until(lambda: drone.path is not None, within_s=1.0)
    lost_by = {
        event.node
        for event in network.events
        if event.kind is MeshEventKind.NEIGHBOUR_LOST
        and event.peer == 1
        and event.now_s >= ordered_s
    }
    assert lost_by >= {2, 3, 4}
