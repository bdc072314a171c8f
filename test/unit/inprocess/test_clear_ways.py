"""A flight for a repair passes no drone at rest whose place is known, and looks up no gateway."""

from __future__ import annotations

import math

import pytest
from scenarios import flown, placed


def passes_m(network, other, until_s):
    """How near any drone that flies for a repair comes to `other`, in metres."""
    nearest_m = math.inf
    while network.now_s() < until_s:
        network.run_for(0.02)
        here = network.location(other)
        nearest_m = min(
            [nearest_m, *(network.location(node).distance_m(here) for node in flown(network))]
        )
    return nearest_m


@pytest.mark.parametrize("routing", ["beacon", "child_table_tree"])
def test_a_flight_leads_round_a_drone_that_hovers_on_its_way(routing):
    network = placed([(0, 0), (8, 0), (16, 0), (11.5, 0)], seed=1, routing=routing)
    assert network.run_until(network.all_connected, within_s=30.0)
    network.order(3, 11.5, 0.0, 4)
    network.run_for(60.0)
    network.power(1, False)
    assert passes_m(network, 3, until_s=network.now_s() + 90.0) >= 1.0
    assert flown(network) == {2}
    assert network.all_connected([2, 3])


def test_a_gateway_that_was_heard_in_flight_last_is_not_looked_for_in_the_air():
    network = placed([(0, 0), (6, 0)], seed=1, routing="beacon")
    assert network.run_until(network.all_connected, within_s=30.0)
    network.order(0, 16.5, 0.0)
    network.run_for(4.0)
    assert network.location(0).height > 8.0
    network.run_for(6.0)
    places = network.nodes[1].component.places
    assert (places.gateway.height, places.good.height) == (0.0, 0.0)
    assert places.gateway.longitude > 6.0
    network.order(0, 12.0, 0.0, 5)
    assert network.run_until(lambda: places.gateway.height == 5.0, within_s=20.0)
