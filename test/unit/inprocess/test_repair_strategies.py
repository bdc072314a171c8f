"""Each repair strategy keeps what it promises, in whole networks."""

from __future__ import annotations

import pytest
from scenarios import LAYOUTS, events, flown, layout, line, run_until

from drone_mesh.communication.repair_interfaces import IRepairStrategy
from drone_mesh.communication.repair_strategies import REPAIR_STRATEGIES, create_repair_strategy
from drone_mesh.errors import ConfigurationError
from drone_mesh.inprocess import Network
from drone_mesh.inprocess.network import ORACLE
from drone_mesh.lab.sequence import run_sequence
from drone_mesh.lab.sequences import harm

FLYING = sorted(set(REPAIR_STRATEGIES) - {"stay"}) + [ORACLE]
RANGE_M = 9.0


def broken_line(repair):
    """Gateway 0, routers 1, 2, 3 in a line; 2 dies, and 3 is cut off."""
    network = line(3, spacing=8.0, repair=repair)
    network.run_for(20.0)
    network.power(2, False)
    assert run_until(network, lambda: not network.connected(3), within_s=30.0, step_s=1.0)
    return network


def start_of(case, node):
    """Where a layout puts a drone."""
    return {other: goal for other, goal in LAYOUTS.orders(case)}[node]


@pytest.mark.parametrize("repair", FLYING)
def test_a_drone_that_is_cut_off_flies_and_is_connected(repair):
    network = broken_line(repair)
    assert run_until(network, network.all_connected, within_s=180.0)
    assert flown(network) == {3}


@pytest.mark.parametrize("repair", FLYING)
def test_no_drone_is_harmed_in_sequences_of_misfortunes(repair):
    outcomes = [run_sequence(seed, repair, largest=12) for seed in range(8)]
    assert [outcome for outcome in outcomes if harm(outcome)] == []


def test_with_stay_no_drone_flies():
    network = broken_line("stay")
    network.run_for(300.0)
    assert flown(network) == set()
    assert not network.connected(3)
    assert network.status().repair_strategy == "stay"
    sentence = network.status().nodes[3].repair
    assert sentence == "waits for a gateway; does not fly: its strategy never flies"


def test_with_home_a_drone_flies_no_farther_than_it_needs_to_be_connected():
    network = broken_line("home")
    assert run_until(network, network.all_connected, within_s=120.0)
    network.run_for(30.0)
    assert 9.0 < network.location(3).longitude < 8.0 + RANGE_M


def test_with_nearest_the_drone_with_the_shortest_flight_flies():
    network = layout(202, repair="nearest")
    network.run_for(20.0)
    network.power(2, False)
    assert run_until(network, lambda: not network.connected(3), within_s=30.0, step_s=1.0)
    assert run_until(network, network.all_connected, within_s=120.0)
    two = start_of(202, 2)
    distances = {n: start_of(202, n).distance_m(two) for n in (3, 4, 5)}
    assert flown(network) == {min(distances, key=distances.get)}


def test_with_inward_no_drone_moves_more_than_half_the_range_at_once():
    network = broken_line("inward")
    before = network.location(3)
    while not network.connected(3) or network.nodes[3].drone.path is not None:
        network.run_for(0.5)
        if any(kind == "LANDED" for kind in _kinds(network, 3)):
            break
    network.run_for(1.0)
    assert 0.0 < network.location(3).distance_m(before) <= RANGE_M / 2 + 0.1


def test_with_follow_no_link_inside_the_moving_part_is_lost():
    network = line(5, spacing=8.0, repair="follow")
    network.run_for(20.0)
    network.power(1, False)
    assert run_until(network, lambda: not network.connected(5), within_s=30.0, step_s=1.0)
    assert run_until(network, network.all_connected, within_s=180.0)
    network.run_for(30.0)
    for one, other in ((2, 3), (3, 4), (4, 5)):
        assert network.location(one).distance_m(network.location(other)) < RANGE_M
    assert max(at_s for at_s, _n, _p in events(network, "FLIGHT_DECIDED")) < 90.0  # as one part


def test_with_field_the_drones_move_towards_the_gateway_leg_by_leg():
    network = broken_line("field")
    assert run_until(network, network.all_connected, within_s=120.0)
    assert network.location(3).longitude < 8.0 + RANGE_M


def test_a_strategy_of_ones_own_is_created_by_its_module_and_class():
    network = Network(repair="drone_mesh.communication.strategies.stay:Stay")
    network.add_router(1, 0.0, 0.0)
    assert isinstance(create_repair_strategy("stay"), IRepairStrategy)


def test_an_unknown_strategy_is_refused_with_the_known_names():
    with pytest.raises(
        ConfigurationError, match="unknown repair strategy 'hope': use one of field"
    ):
        Network(repair="hope")


def _kinds(network, node):
    return [event.kind.name for event in network.events if event.node == node]
