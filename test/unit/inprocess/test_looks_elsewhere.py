"""Drones that the gateway does not hear even beside it: where they look for another way."""

from __future__ import annotations

import pytest
from scenarios import events, placed

GATEWAY = (0.0, 0.0)
HEARS_BOTH = (-0.5, 1.5)
BEHIND = (7.0, 0.0)
RELAY = (-8.5, 0.0)


@pytest.mark.parametrize("routing", ["child_table_tree", "beacon"])
def test_drones_that_the_gateway_does_not_hear_look_for_a_relay_of_which_one_of_them_knows(
    routing,
):
    """The one that knows it has lost that link, too; the other one looks where the first did."""
    network = placed([GATEWAY, BEHIND, HEARS_BOTH, RELAY], routing=routing)
    network.run_for(120.0)
    assert network.all_connected()
    for one, other in [(0, 1), (0, 2), (2, 3)]:
        network.air.cut(one, other)
    assert network.run_until(lambda: not network.connected(1), within_s=60.0)
    assert network.run_until(network.all_connected, within_s=1500.0)
    network.run_for(60.0)
    assert network.all_connected()
    assert network.location(3).to_vector() == (*RELAY, 0.0)


@pytest.mark.parametrize("routing", ["child_table_tree", "beacon"])
def test_while_the_gateway_is_off_a_drone_looks_beside_a_dead_relay_once_and_comes_back(routing):
    network = placed([GATEWAY, BEHIND, HEARS_BOTH, RELAY], routing=routing)
    network.run_for(120.0)
    network.power(0, False)
    network.power(3, False)
    network.run_for(3600.0)
    looks = [node for _s, node, to in events(network, "FLIGHT_DECIDED") if to == 3]
    assert 1 <= len(looks) <= 2
    assert len(set(looks)) == len(looks)
    assert all(network.location(node).distance_m(network.location(0)) < 3.0 for node in (1, 2))
    network.power(0, True)
    assert network.run_until(lambda: network.all_connected([1, 2]), within_s=60.0)
