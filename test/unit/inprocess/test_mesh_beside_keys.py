"""A mesh without a key beside one with a key: the bytes of seals teach it no routes."""

from __future__ import annotations

import pytest

from drone_mesh.communication.events.observer import MeshEventKind
from drone_mesh.communication.seals.keys import MeshKey
from drone_mesh.inprocess import Network

MINUTES = 20


@pytest.mark.parametrize("seed", [0, 1])
@pytest.mark.parametrize("routing", ["babel", "dsdv"])
def test_it_stays_connected_and_no_drone_flies(routing, seed):
    sealed = Network(seed=seed, routing=routing, key=MeshKey(bytes(range(16))))
    sealed.add_gateway(0, 0.0, 0.0)
    network = Network(seed=seed + 50, radio=sealed.air, routing=routing)
    network.add_gateway(100, 0.0, 3.0)
    for node in range(1, 5):
        sealed.add_router(node, 6.0 * node, 0.0)
        network.add_router(100 + node, 6.0 * node, 3.0)
    sealed.run_for(60.0)
    cut_off = []
    for _ in range(MINUTES):
        sealed.run_for(60.0)
        cut_off += [node for node in range(101, 105) if not network.connected(node)]
    assert cut_off == []
    assert not [e for e in network.events if e.kind is MeshEventKind.FLIGHT_DECIDED]
