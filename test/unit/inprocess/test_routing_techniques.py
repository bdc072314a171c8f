"""Every routing technique keeps a mesh; what each gains on links that lose packets."""

from __future__ import annotations

import random

import pytest
import scenarios

from drone_mesh.communication.node.node_configuration import ROUTING_TECHNIQUES
from drone_mesh.inprocess import Network
from drone_mesh.inprocess.bounds import SHORTEST_PATH

ALL = [*ROUTING_TECHNIQUES, SHORTEST_PATH]
FOR_CROWDS = [name for name in ALL if name != "flooding"]  # its packets grow with the square


def grid(technique, nodes, loss=0.0, seed=1):
    network = Network(seed=seed, routing=technique, loss=loss)
    network.add_fleet(gateways=1, routers=nodes - 1, gridsize=round(nodes**0.5), spacing=6.0)
    return network


def connected_share(network, seconds):
    """The mean share of nodes that are connected, sampled each second."""
    shares = []
    for _ in range(seconds):
        network.run_for(1.0)
        shares.append(sum(map(network.connected, network.nodes)) / len(network.nodes))
    return sum(shares) / len(shares)


@pytest.mark.parametrize("technique", ALL)
def test_a_mesh_connects_stays_connected_and_orders_reach_every_drone(technique):
    network = grid(technique, nodes=17)
    assert network.run_until(network.all_connected, within_s=5.0)
    network.run_for(15.0)
    assert connected_share(network, seconds=60) == 1.0
    assert scenarios.flown(network) == set()
    for node in network.nodes.values():
        assert not any("circulates" in reason for reason in node.component.complaints.counts)
    for node in range(1, 17):
        place = network.location(node)
        assert network.order(node, place.longitude, place.latitude, height=1)
    network.run_for(5.0)
    assert [network.location(node).height for node in range(1, 17)] == [1.0] * 16


@pytest.mark.parametrize("technique", FOR_CROWDS)
def test_of_100_nodes_30_die_and_all_that_have_a_path_stay_or_come_back(technique):
    network = grid(technique, nodes=100)
    assert network.run_until(network.all_connected, within_s=15.0)
    network.run_for(20.0)
    for node in random.Random(2).sample(range(1, 100), 30):
        network.power(node, False)
    network.run_for(20.0)
    with_path = network.shortest_hops()
    assert network.run_until(lambda: network.all_connected(with_path), within_s=40.0)


@pytest.mark.parametrize("technique", FOR_CROWDS)
def test_254_nodes_connect(technique):
    network = grid(technique, nodes=254)
    assert network.run_until(network.all_connected, within_s=15.0)


@pytest.mark.parametrize("technique", ALL)
def test_layout_101_finds_the_detour_when_router_4_is_off(technique):
    network = scenarios.layout(101, routing=technique)
    assert network.run_until(network.all_connected, within_s=15.0)
    network.run_for(20.0)
    network.power(4, False)
    network.run_for(11.0)
    assert network.run_until(lambda: network.connected(6), within_s=40.0)
    network.run_for(11.0)
    assert network.connected(6)


@pytest.mark.parametrize("technique", ALL)
@pytest.mark.parametrize(("case", "off"), [(201, (2,)), (202, (1,))])
def test_the_layouts_that_need_a_flight_are_repaired(technique, case, off):
    network = scenarios.layout(case, routing=technique)
    assert network.run_until(network.all_connected, within_s=15.0)
    network.run_for(25.0)
    for node in off:
        network.power(node, False)
    network.run_for(31.0)
    assert scenarios.run_until(network, network.all_connected, within_s=180.0)
    assert scenarios.flown(network)


def share_on_losing_links(technique):
    """Of 100 nodes whose links lose a fifth of all packets."""
    network = grid(technique, nodes=100, loss=0.2)
    network.run_for(30.0)
    return connected_share(network, seconds=30)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("technique", "least"),
    [
        ("child_table_tree", 0.6),
        ("batman", 0.6),
        ("etx_tree", 0.85),
        ("babel", 0.95),
        (SHORTEST_PATH, 0.99),
    ],
)
def test_on_links_that_lose_a_fifth_etx_and_babel_connect_far_more_nodes_than_the_tree(
    technique, least
):
    assert share_on_losing_links(technique) > least


def test_flooding_survives_links_that_lose_a_fifth():
    network = grid("flooding", nodes=17, loss=0.2)
    network.run_for(10.0)
    assert connected_share(network, seconds=60) == 1.0


@pytest.mark.parametrize("technique", FOR_CROWDS)
def test_the_same_seed_gives_the_same_run(technique):
    one, other = (grid(technique, nodes=26, loss=0.1) for _ in range(2))
    for network in (one, other):
        network.run_for(60.0)
    assert one.events == other.events


def test_no_technique_knows_a_shorter_path_than_the_bound():
    network = grid(SHORTEST_PATH, nodes=50)
    network.run_for(30.0)
    assert {n: network.hops(n) for n in network.nodes} == network.shortest_hops()
