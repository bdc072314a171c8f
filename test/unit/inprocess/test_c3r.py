"""The drones beside a dead relay hold its place in turn, and return to their own."""

from __future__ import annotations

import pytest
from scenarios import events, placed

from drone_mesh.communication.repair.c3r import TURN_S, TURNS

# 2, 3 and 4 need 1, and 5 stands behind them; 3 is the nearest to 1, then 2.
PLACES = ((0, 0), (8, 0), (14, 5), (15, -3), (16, 1), (22, 4))
BESIDE = {2, 3, 4}


@pytest.mark.parametrize("routing", ["beacon", "child_table_tree"])
def test_neighbours_hold_the_place_in_turn_and_return_until_each_had_its_turns(routing):
    """Who leaves has given up its connection."""
    network = placed(PLACES, repair="c3r", routing=routing)
    network.run_for(40.0)
    network.power(1, False)
    network.run_for(1200.0)
    flights = events(network, "FLIGHT_DECIDED")
    visits = [(at_s, node) for at_s, node, peer in flights if node != peer]
    returns = [(at_s, node) for at_s, node, peer in flights if node == peer]
    order = [node for _at_s, node in visits]
    assert order[:3] == [3, 2, 4]  # the nearest first
    assert {node: order.count(node) for node in BESIDE} == {
        node: TURNS + (node == order[-1]) for node in BESIDE
    }
    assert [node for _at_s, node in returns] == order[:-1]  # the last one stays
    assert set(returns) <= {(at_s, node) for at_s, node, _ in events(network, "DISCONNECTED")}
    for (came_s, _node), (left_s, _same) in zip(visits, returns):
        assert TURN_S <= left_s - came_s < TURN_S + 30.0
    assert network.all_connected()
    for node in {2, 3, 4, 5} - {order[-1]}:
        here = network.location(node)
        assert (here.longitude, here.latitude) == pytest.approx(PLACES[node], abs=0.1)


@pytest.mark.parametrize(("routing", "cut_off_s"), [("beacon", 11.0), ("child_table_tree", 26.0)])
def test_at_a_change_of_turns_the_group_is_cut_off_for_seconds(routing, cut_off_s):
    network = placed(PLACES, repair="c3r", routing=routing)
    network.run_for(40.0)
    network.power(1, False)
    assert network.run_until(lambda: events(network, "FLIGHT_DECIDED"), 100.0)
    assert network.run_until(network.all_connected, 20.0)
    network.run_until(lambda: not network.all_connected(), 100.0)
    left_s = network.clock.now_s
    assert network.run_until(network.all_connected, 60.0)
    assert network.clock.now_s - left_s == pytest.approx(cut_off_s, abs=1.0)


def test_a_drone_that_nobody_could_relieve_stays():
    network = placed([(8 * node, 0) for node in range(3)], repair="c3r", routing="beacon")
    network.run_for(40.0)
    network.power(1, False)
    network.run_for(300.0)
    assert network.all_connected()
    assert len(events(network, "FLIGHT_DECIDED")) == 1
