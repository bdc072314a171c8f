"""The medium, or the gateway, is gone for a while: what flies, and where it stands in the end."""

from __future__ import annotations

import itertools

import pytest
from scenarios import events, fleet

FEW, MANY = (24, 5), (99, 10)
CONNECTED_WITHIN_S = 15.0
CLEARANCE_M = 1.0


def standing(network):
    return {node: network.location(node) for node in network.nodes}


def closest_m(network):
    places = standing(network).values()
    return min(one.distance_m(other) for one, other in itertools.combinations(places, 2))


def still_where_they_were(network, before):
    return sum(network.location(node).distance_m(place) < 0.1 for node, place in before.items())


@pytest.mark.parametrize(
    ("grid", "gone_s", "registered"),
    [
        *itertools.product([FEW], [35.0, 120.0, 600.0], [True, False]),
        pytest.param(MANY, 120.0, True, marks=pytest.mark.slow),
    ],
)
def test_after_a_blackout_all_are_connected_and_no_drone_stands_on_another(
    grid, gone_s, registered
):
    """A simulator that restarts registers the antennas again; after a jammer nothing does."""
    network = fleet(*grid)
    network.run_for(30.0)
    assert network.all_connected()
    before = standing(network)
    network.air.loss = 1.0
    network.run_for(gone_s)
    network.air.loss = 0.0
    for node in network.nodes.values():
        if registered:
            node.component.on_antenna_registered(network.clock.now_s)
            node.plan()
    assert network.run_until(network.all_connected, within_s=CONNECTED_WITHIN_S)
    network.run_for(60.0)
    assert network.all_connected()
    assert closest_m(network) >= CLEARANCE_M
    if gone_s <= 120.0:
        assert still_where_they_were(network, before) >= 0.9 * len(before)


@pytest.mark.parametrize(
    ("grid", "gone_s"),
    [
        *itertools.product([FEW], [45.0, 120.0, 600.0]),
        pytest.param(MANY, 120.0, marks=pytest.mark.slow),
    ],
)
def test_while_the_gateway_is_off_at_most_one_drone_a_minute_flies_and_none_stands_on_another(
    grid, gone_s
):
    network = fleet(*grid)
    network.run_for(30.0)
    network.power(0, False)
    network.run_for(gone_s)
    flights_s = [at_s for at_s, _node, _to in events(network, "FLIGHT_DECIDED")]
    assert all(later - one >= 60.0 for one, later in zip(flights_s, flights_s[1:]))
    network.power(0, True)
    assert network.run_until(network.all_connected, within_s=CONNECTED_WITHIN_S)
    network.run_for(60.0)
    assert network.all_connected()
    assert closest_m(network) >= CLEARANCE_M
