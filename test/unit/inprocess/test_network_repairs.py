"""Whole networks that lose nodes, links, gateways or the medium, and heal.

docs/protocol.md, "What the rules achieve".
"""

from __future__ import annotations

import math
import random

import pytest
from scenarios import (
    assert_hops_are_paths,
    events,
    fleet,
    flown,
    layout,
    line,
    placed,
    run_until,
)

from drone_mesh.communication.interfaces import OrderState
from drone_mesh.communication.seals.keys import MeshKey
from drone_mesh.inprocess import Network
from drone_mesh.mobility import Area, Mobility, tracks_of

TWO_MINUTES_S = 120.0


def horizontally(network, node):
    place = network.location(node)
    return round(place.longitude, 2), round(place.latitude, 2)


def stands_beside(network, node, x, y):
    """Whether a drone is next to this place, clear of the silent one that may still be there."""
    return 1.0 <= math.dist(horizontally(network, node), (x, y)) < 1.2


def diamond(radio="disc"):
    """Gateway 0, router 3 behind routers 1 and 2, and router 4 behind it."""
    places = [(0.0, 0.0), (5.0, 4.0), (5.0, -4.0), (10.0, 0.0), (18.0, 0.0)]
    network = placed(places, seed=0, radio=radio)
    network.run_for(20.0)
    assert [network.hops(node) for node in range(1, 5)] == [1, 1, 2, 3]
    return network


def last_order(network):
    return network.nodes[0].component.get_orders()[-1].state


# Detours and partitions ----------------------------------------------------------------------


@pytest.mark.parametrize("radio", ["disc", "shared"])
def test_a_relay_that_is_ordered_away_tells_those_behind_it_to_take_another_way_first(radio):
    network = diamond(radio)
    relay = network.nodes[3].component.get_route_to_gateway()
    x, y = horizontally(network, relay)
    assert network.order(relay, x, 10.0 * y)
    for _second in range(30):
        network.run_for(1.0)
        for node in (3, 4):
            hop = network.nodes[node].component.get_route_to_gateway()
            assert hop in network.air.in_range(node), f"node {node} goes through {hop}"


def test_packets_take_a_detour_when_a_link_is_cut():
    network = diamond()
    relay = network.nodes[3].component.get_route_to_gateway()
    network.air.cut(relay, 3)
    network.run_for(30.0)
    assert network.all_connected()
    assert network.path_to_gateway(4) == [4, 3, 3 - relay, 0]
    assert flown(network) == set()


def test_a_partition_is_noticed_and_mended_links_are_found_again():
    network = diamond()
    network.air.cut(1, 3)
    network.air.cut(2, 3)
    assert network.run_until(
        lambda: not network.connected(3) and not network.connected(4), within_s=30.0
    )
    network.air.cut(1, 3, off=False)
    assert network.run_until(network.all_connected, within_s=30.0)
    assert_hops_are_paths(network)
    network.run_for(TWO_MINUTES_S)
    assert flown(network) == set()
    assert network.all_connected()


def test_all_nodes_learn_that_a_node_is_missing_and_that_it_is_back():
    network = line(4)
    network.run_for(20.0)
    network.power(4, False)
    network.run_for(20.0)
    network.order(4, x=24.0, y=1.0)
    network.run_for(4.0)
    assert last_order(network) is OrderState.NO_ROUTE
    network.power(4, True)
    network.run_for(12.0)
    network.order(4, x=24.0, y=2.0)
    network.run_for(0.1)
    assert last_order(network) is OrderState.ACCEPTED


@pytest.mark.parametrize(("key", "asks_s"), [(None, 0.6), (MeshKey(bytes(range(16))), 2.0)])
def test_on_a_shared_channel_a_key_gives_neighbours_time_for_a_handshake_before_they_answer(
    key, asks_s
):
    """A drone that has landed asks twice who is there; without an answer it stays where it is."""
    network = line(2, spacing=7.0, seed=1, radio="shared", key=key)
    network.run_for(60.0)
    network.power(1, False)
    component = network.nodes[2].component

    def on_ground():
        return component.get_repair_status().landed

    assert run_until(network, on_ground, within_s=120.0, step_s=0.05)
    landed_s = network.now_s()
    run_until(network, lambda: not component.get_repair_status().landed, within_s=10.0, step_s=0.05)
    assert network.now_s() - landed_s == pytest.approx(asks_s, abs=0.1)


# The layouts of the original's experiments ---------------------------------------------------


@pytest.mark.parametrize("seed", range(3))
def test_layout_101_heals_first_by_a_detour_and_then_by_a_flight(seed):
    network = layout(101, seed=seed)
    network.run_for(20.0)
    network.power(3, False)
    network.power(6, False)
    network.run_for(30.0)
    assert network.connected(5)
    assert network.path_to_gateway(5)[:2] == [5, 4]
    assert network.hops(5) == 3
    off_s = network.clock.now_s
    network.power(4, False)
    assert network.run_until(lambda: not network.connected(5), within_s=30.0)
    assert run_until(network, lambda: events(network, "LANDED") != [], TWO_MINUTES_S, step_s=1.0)
    assert network.run_until(lambda: network.connected(5), within_s=5.0)
    # In its own spot of a block beside (3, 10), as 3 and 6 may fly there, too.
    assert horizontally(network, 5) == (1.1, 8.8)
    assert network.clock.now_s - off_s < TWO_MINUTES_S
    assert flown(network) == {5}
    assert [at_s for at_s, node, _ in events(network, "DISCONNECTED") if node in (1, 2)] == []


@pytest.mark.parametrize("seed", range(3))
def test_layout_102_without_its_middle_finds_a_detour_without_a_flight(seed):
    network = layout(102, seed=seed)
    network.run_for(20.0)
    for node in (2, 5, 8):
        network.power(node, False)
    network.run_for(30.0)
    assert network.all_connected()
    assert network.hops(3) == 7
    assert_hops_are_paths(network, above_shortest=0)
    network.run_for(60.0)
    assert flown(network) == set()


@pytest.mark.parametrize("seed", range(3))
def test_layout_201_without_node_2_brings_node_3_beside_its_place(seed):
    network = layout(201, seed=seed)
    network.run_for(20.0)
    network.power(2, False)
    assert run_until(network, lambda: not network.connected(3), within_s=30.0, step_s=1.0)
    assert run_until(network, network.all_connected, within_s=90.0, step_s=1.0)
    network.run_for(10.0)
    assert network.all_connected()
    assert stands_beside(network, 3, -1.0, 10.0)
    assert flown(network) == {3}


@pytest.mark.parametrize("seed", range(3))
def test_layout_202_without_node_1_is_whole_again_within_two_minutes(seed):
    network = layout(202, seed=seed)
    network.run_for(20.0)
    off_s = network.clock.now_s
    network.power(1, False)
    network.run_for(15.0)
    assert not network.all_connected()
    assert run_until(network, network.all_connected, within_s=TWO_MINUTES_S - 15.0)
    network.run_for(60.0)
    assert network.all_connected()
    assert stands_beside(network, 2, -1.0, 4.0)
    assert 4 not in flown(network, since_s=off_s) or 5 not in flown(network, since_s=off_s)


# Emergencies ---------------------------------------------------------------------------------


def test_a_drone_that_is_alone_flies_back_step_by_step_until_it_is_connected():
    """Both relays die: its first step leads to the place of the first, where no node is left.

    So it returns, and then flies to the gateway.
    """
    network = line(3, spacing=8.0)
    network.run_for(20.0)
    network.power(1, False)
    network.power(2, False)
    network.run_for(15.0)
    assert not network.connected(3)
    assert run_until(network, network.all_connected, within_s=225.0)
    assert [to for _at_s, _node, to in events(network, "FLIGHT_DECIDED")] == [2, 3, 0]


def test_a_drone_that_never_knew_a_gateway_stays():
    network = Network()
    network.add_router(1, 0.0, 0.0)
    network.add_router(2, 6.0, 0.0)
    network.run_for(300.0)
    assert flown(network) == set()
    assert len(events(network, "EMERGENCY")) >= 2


def test_of_a_group_the_one_that_is_farthest_from_the_gateway_flies():
    """3 and 4 both lost relay 2, and only they can take its place."""
    network = placed([(0.0, 0.0), (8.0, 0.0), (16.0, 0.0), (23.0, 3.0), (23.0, -4.0)])
    network.run_for(20.0)
    network.power(2, False)
    network.run_for(15.0)
    assert not network.connected(3)
    assert not network.connected(4)
    assert run_until(network, network.all_connected, within_s=TWO_MINUTES_S - 15.0)
    network.run_for(30.0)
    assert network.all_connected()
    assert flown(network) == {4}
    assert stands_beside(network, 4, 16.0, 0.0)


@pytest.mark.parametrize("victim", [3, 4])
@pytest.mark.parametrize("after_s", [0.0, 0.001, 0.003, 1.0])
def test_a_neighbour_that_dies_during_a_negotiation_does_not_delay_it(victim, after_s):
    network = placed([(0.0, 0.0), (8.0, 0.0), (16.0, 0.0), (23.0, 3.0), (23.0, -4.0)])
    network.run_for(20.0)
    network.power(2, False)
    while not events(network, "NEGOTIATION_STARTED"):
        network.clock.run_until(network.clock.next_event_s())
    network.run_for(after_s)
    network.power(victim, False)
    assert run_until(network, network.all_connected, within_s=2 * TWO_MINUTES_S)
    network.run_for(30.0)
    assert network.all_connected()


def test_an_order_to_a_place_200_m_away_is_not_turned_round_in_flight():
    network = line(1)
    network.run_for(20.0)
    network.order(1, x=206.0, y=0.0)
    ordered_s = network.clock.now_s
    network.run_for(99.0)  # 200 m at 2 m/s
    assert flown(network) == set()
    assert network.location(1).longitude > 190.0
    network.run_for(3.0)
    assert [at_s for at_s, _n, _p in events(network, "LANDED")] == [
        pytest.approx(ordered_s + 100.0, abs=1.5)
    ]
    assert horizontally(network, 1) == (206.0, 0.0)
    network.run_for(25.0)  # the time without a gateway begins after the landing
    assert flown(network) == set()
    assert run_until(network, network.all_connected, within_s=240.0)
    assert flown(network) == {1}


def test_a_whole_chain_that_is_ordered_away_from_the_far_end_gets_where_it_was_sent():
    network = line(4, spacing=5.0)
    network.run_for(20.0)
    for node in (4, 3, 2, 1):
        assert network.order(node, x=7.0 * node, y=3.0)
    assert run_until(network, lambda: len(events(network, "LANDED")) == 4, within_s=30.0)
    assert network.run_until(network.all_connected, within_s=60.0)
    assert [horizontally(network, node) for node in range(1, 5)] == [
        (7.0 * node, 3.0) for node in range(1, 5)
    ]


# The gateway, and the medium -----------------------------------------------------------------


def test_a_gateway_that_dies_is_missed_and_one_that_comes_back_is_found():
    network = fleet(9, gridsize=3)
    network.run_for(20.0)
    network.power(0, False)
    assert network.run_until(
        lambda: not any(network.connected(node) for node in range(1, 10)), within_s=30.0
    )
    network.power(0, True)
    assert network.run_until(network.all_connected, within_s=20.0)
    network.run_for(10.0)
    assert_hops_are_paths(network)
    assert flown(network) == set()


@pytest.mark.parametrize("routing", ["child_table_tree", "beacon"])
def test_the_only_drone_that_can_fly_looks_again_for_a_gateway_that_was_off_for_minutes(routing):
    network = Network(routing=routing)
    network.add_gateway(0, 0.0, 0.0)
    network.add_router(1, 7.0, 0.0)
    network.add_router(2, 14.0, 0.0)
    network.add_router(3, 20.0, 0.0, why_not_fly="stands on a roof")
    network.run_for(60.0)
    network.power(1, False)
    network.power(0, False)
    network.run_for(300.0)  # it was at both places in vain, and is back
    assert network.location(2).distance_m(network.location(0)) > 9.0
    network.power(0, True)
    assert network.run_until(lambda: network.connected(2), within_s=900.0)


# Many at once --------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(2))
def test_of_100_routers_30_die_and_all_that_have_a_path_are_back_within_30_s(seed):
    network = fleet(100, gridsize=10, seed=seed)
    network.run_for(21.0)
    assert network.all_connected()
    for node in random.Random(seed).sample(range(1, 101), 30):
        network.power(node, False)
    with_path = set(network.shortest_hops())
    network.run_for(30.0)
    assert network.all_connected(with_path)
    assert all(network.path_to_gateway(node) for node in with_path)
    network.run_for(60.0)
    assert network.all_connected(with_path)
    assert_hops_are_paths(network)
    assert flown(network) & with_path == set()


def test_a_drone_that_was_ordered_out_of_range_does_not_blame_its_medium():
    network = fleet(routers=2, gridsize=2)
    network.run_for(30.0)
    network.order(1, -13.0, 24.0)
    network.run_for(30.0)  # it has landed, and both its neighbours fell silent on the way
    assert network.location(1).latitude == 24.0
    assert run_until(network, lambda: network.connected(1), within_s=60.0)


# Neighbours that others fly --------------------------------------------------------------------


def with_a_relay_that_comes_and_goes():
    """Gateway 0, router 2 at rest, and between them relay 1, out of reach for 62 s of 147 s."""
    network = placed([(0.0, 0.0), (6.0, -6.0), (12.0, 0.0)], seed=1)
    turns = [(73.3 * turn, 6.0, 16.0 if turn % 2 else -6.0, 0.0) for turn in range(6)]
    mobility = Mobility("trace", knots={1: turns})
    network.fly(tracks_of(mobility, {1: (6.0, -6.0, 0.0)}, [], Area(0.0, 0.0, 12.0, 12.0), seed=1))
    return network


def test_no_drone_flies_for_a_moving_neighbour_that_comes_back():
    network = with_a_relay_that_comes_and_goes()
    network.run_for(300.0)
    assert len(events(network, "DISCONNECTED")) >= 4
    assert flown(network) == set()


def test_a_moving_neighbour_that_dies_is_replaced_all_the_same():
    network = with_a_relay_that_comes_and_goes()
    network.run_for(30.0)
    network.power(1, False)
    network.run_for(90.0)
    assert flown(network) == set()
    network.run_for(30.0)
    assert flown(network) == {2}


def test_a_drone_lands_clear_of_one_that_died_a_second_after_it_had_connected():
    """Nobody had asked 3 for its place, and no drone in reach of the lost relay is left."""
    network = placed([(0.0, 0.0), (8.0, 0.0), (16.0, 0.0), (16.0, 1.1), (24.0, 0.0)], seed=1)
    assert network.run_until(network.all_connected, within_s=30.0)
    network.run_for(1.0)
    network.power(3, False)
    network.run_for(60.0)
    network.power(1, False)
    network.power(2, False)
    dead, nearest_m = network.location(3), math.inf
    while network.now_s() < 150.0:
        network.run_for(0.1)
        nearest_m = min(nearest_m, network.location(4).distance_m(dead))
    assert flown(network) == {4}
    assert nearest_m >= 1.0
