"""Networks with two gateways: side by side, far apart, and when one of them dies."""

from __future__ import annotations

import pytest
from scenarios import assert_hops_are_paths, between_gateways, events, fleet, flown, run_until


def heartbeats_between_gateways(network):
    """Count heartbeats from one gateway to the other from now on."""
    counted = []
    send = network.air.send

    def counting(payload):
        if payload[2] == 4 and payload[0] in (0, 1) and payload[4] in (0, 1):
            counted.append(payload)
        return send(payload)

    network.air.send = counting
    return counted


def test_heartbeats_between_two_gateways_do_not_multiply():
    network = fleet(16, gridsize=4, gateways=2)
    counted = heartbeats_between_gateways(network)
    network.run_for(100.0)
    # Each sends one in a check, and perhaps one at the start.
    assert 2 * 10 - 2 <= len(counted) <= 2 * 10 + 2


@pytest.mark.parametrize("seed", range(2))
def test_preferred_gateways_side_by_side_do_not_flap(seed):
    network = fleet(16, gridsize=4, gateways=2, seed=seed)
    network.run_for(15.0)
    assert network.all_connected()
    assert_hops_are_paths(network)
    network.run_for(300.0)
    assert events(network, "GATEWAY_CHANGED", "DISCONNECTED", since_s=15.0) == []
    assert_hops_are_paths(network)


@pytest.mark.parametrize("seed", range(2))
def test_preferred_gateways_far_apart_settle_on_the_near_one_and_do_not_flap(seed):
    network = between_gateways(8, seed=seed)
    network.run_for(60.0)
    assert network.all_connected()
    preferred = [network.nodes[n].component.get_preferred_gateway() for n in range(2, 10)]
    assert preferred == [0, 0, 0, 0, 1, 1, 1, 1]
    assert_hops_are_paths(network)
    network.run_for(300.0)
    assert events(network, "GATEWAY_CHANGED", "DISCONNECTED", since_s=60.0) == []


@pytest.mark.parametrize("dead", [0, 1])
def test_killing_one_gateway_moves_its_routers_to_the_other(dead):
    network = fleet(16, gridsize=4, gateways=2)
    network.run_for(20.0)
    network.power(dead, False)
    network.run_for(30.0)
    assert network.all_connected()
    preferred = {network.nodes[n].component.get_preferred_gateway() for n in range(2, 18)}
    assert preferred == {1 - dead}
    assert_hops_are_paths(network)
    network.run_for(60.0)
    assert flown(network) == set()


def test_the_routers_of_a_gateway_that_dies_go_to_another_far_away_and_come_back_to_it():
    network = between_gateways(8)
    network.run_for(60.0)
    network.power(1, False)
    network.run_for(30.0)
    assert network.all_connected()
    assert network.hops(9) == 8
    network.run_for(30.0)
    assert flown(network) == set()
    network.power(1, True)
    assert run_until(network, lambda: network.hops(9) == 1, within_s=20.0, step_s=1.0)
    network.run_for(60.0)
    assert_hops_are_paths(network, above_shortest=0)
    preferred = [network.nodes[n].component.get_preferred_gateway() for n in range(2, 10)]
    assert preferred == [0, 0, 0, 0, 1, 1, 1, 1]
    assert events(network, "DISCONNECTED", since_s=120.0) == []


def test_an_order_of_both_gateways_is_one_flight():
    network = fleet(4, gridsize=2, gateways=2)
    network.run_for(20.0)
    assert network.order(3, x=4.0, y=1.0, gateway=0)
    assert network.order(3, x=4.0, y=1.0, gateway=1)
    network.run_for(30.0)
    assert len(events(network, "LANDED")) == 1
    assert network.all_connected()
    place = network.location(3)
    assert (place.longitude, place.latitude) == (4.0, 1.0)


def test_every_drone_is_reached_by_one_gateway_or_the_other():
    network = fleet(16, gridsize=4, gateways=2)
    network.run_for(30.0)
    for node in range(2, 18):
        assert any(network.order(node, x=2.0 * node, y=50.0, gateway=g) for g in (0, 1))
