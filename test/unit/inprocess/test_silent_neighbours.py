"""Meshes in which only one node knows what a repair needs: who is silent, and whose link failed."""

from __future__ import annotations

import pytest
from scenarios import flown, placed, run_until

from drone_mesh.communication.seals.keys import MeshKey

TECHNIQUES = ["child_table_tree", "beacon"]


@pytest.mark.parametrize("key", [None, MeshKey(bytes(range(16)))])
@pytest.mark.parametrize("routing", TECHNIQUES)
def test_a_drone_that_follows_its_relay_keeps_clear_of_silent_ones_that_only_that_one_knew(
    routing, key
):
    """2 and 3 hang silent beside relay 1 when 4 comes; 4 lands where 1 had been, and asks nobody.

    Later 4 is restarted, and asks again.
    """
    network = placed([(-0.8, 0), (8, 0), (7.8, 1.3), (7.8, -1.3)], routing=routing, key=key)
    network.run_for(30.0)
    silent = {node: network.location(node) for node in (2, 3)}
    for node in silent:
        network.power(node, False)
    network.run_for(30.0)
    network.add_router(4, 16.0, 0.0)
    network.run_for(80.0)
    network.restart(4)
    assert run_until(network, lambda: network.connected(4), within_s=60.0)
    network.run_for(70.0)
    network.power(1, False)
    while flown(network) != {4} or not network.connected(4):
        network.run_for(0.1)
        assert min(network.location(4).distance_m(place) for place in silent.values()) >= 1.0


@pytest.mark.parametrize("key", [None, MeshKey(bytes(range(16)))])
@pytest.mark.parametrize("routing", TECHNIQUES)
def test_a_relay_that_was_restarted_learns_from_its_next_hop_who_is_silent_beside_it(routing, key):
    """Drone 3 dies beside relay 2, and 1, 2 and 4 forget it: only the gateway knows."""
    places = [(11.59, 5.81), (0.56, 5.23), (4.72, 10.35), (5.37, 8.44), (0.82, 6.63)]
    network = placed(places, routing=routing, key=key)
    network.run_for(1.0)
    silent = network.location(3)
    network.power(3, False)
    network.run_for(13.0)
    for node in (1, 2, 4):
        network.restart(node)
    network.run_for(73.0)
    network.power(2, False)
    network.run_for(4.0)
    network.restart(4)  # 1 alone knows where 2 was
    while flown(network) != {1} or network.nodes[1].drone.path is not None:
        network.run_for(0.1)
        assert network.location(1).distance_m(silent) >= 1.0


@pytest.mark.parametrize("routing", TECHNIQUES)
def test_another_drone_looks_for_a_gateway_where_one_stands_that_does_not_hear_it(routing):
    """The links of 1 and 2 to the gateway fail for good: 1 flies to it in vain. 3 never had one."""
    network = placed([(0, 0), (-2, -6), (-3, 2), (-8.9, 1.5)], routing=routing)
    network.run_for(30.0)
    for node in (1, 2):
        network.air.cut(0, node)
    network.run_for(60.0)
    assert not network.all_connected()
    assert run_until(network, network.all_connected, within_s=1000.0)
    assert flown(network) == {1, 3}
