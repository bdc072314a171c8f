"""A gateway whose internet fails says so; its routers move to another one and come back."""

from __future__ import annotations

import pytest
from scenarios import between_gateways, events, fleet, flown, line, run_until

from drone_mesh.communication.interfaces import OrderState
from drone_mesh.communication.seals.keys import MeshKey
from drone_mesh.communication.timing import MeshTiming
from drone_mesh.inprocess import Network

CHECK_PERIOD_S = 10.0
TECHNIQUES = ["child_table_tree", "beacon"]


def two_ends(routing, routers=6, **options):
    network = between_gateways(routers, seed=1, routing=routing, **options)
    network.run_for(40.0)
    assert network.all_connected()
    return network


def preferred(network, nodes):
    return [network.nodes[node].component.get_preferred_gateway() for node in nodes]


def settled(network, expected, hops):
    nodes = list(expected)
    return (
        network.all_connected()
        and preferred(network, nodes) == list(expected.values())
        and all(network.hops(node) == hops[node] for node in nodes)
    )


@pytest.mark.parametrize("routing", TECHNIQUES)
def test_routers_move_to_the_other_gateway_and_come_back(routing):
    network = two_ends(routing)
    before = {2: 0, 3: 0, 4: 0, 5: 1, 6: 1, 7: 1}
    hops = {2: 1, 3: 2, 4: 3, 5: 3, 6: 2, 7: 1}
    assert settled(network, before, hops)

    network.internet(0, False)
    moved = dict.fromkeys(range(2, 8), 1)
    far = {node: 8 - node for node in range(2, 8)}
    within_s = CHECK_PERIOD_S + 2.0
    assert run_until(network, lambda: settled(network, moved, far), within_s, step_s=0.5)
    gateway = network.nodes[0].component
    assert gateway.get_preferred_gateway() == 1
    assert gateway.get_hops_from_gateway_away() == 7

    network.run_for(60.0)
    assert settled(network, moved, far)
    network.internet(0, True)
    back = {2: 0, 3: 0, 7: 1}  # the others are about as far from both
    assert run_until(network, lambda: settled(network, back, hops), 3 * CHECK_PERIOD_S, step_s=0.5)
    assert gateway.get_preferred_gateway() == 0
    assert gateway.get_hops_from_gateway_away() == 0
    assert flown(network) == set()


@pytest.mark.slow
@pytest.mark.parametrize("radio", ["disc", "shared"])
@pytest.mark.parametrize("routing", TECHNIQUES)
def test_routers_move_and_come_back_in_a_mesh_with_a_key_and_on_a_shared_channel(routing, radio):
    network = two_ends(routing, routers=4, radio=radio, key=MeshKey(bytes(range(16))))
    network.internet(0, False)
    assert run_until(
        network,
        lambda: network.all_connected() and set(preferred(network, network.nodes)) == {1},
        CHECK_PERIOD_S + 2.0,
        step_s=0.5,
    )
    network.internet(0, True)
    assert run_until(
        network,
        lambda: network.all_connected() and preferred(network, [0, 2]) == [0, 0],
        2 * CHECK_PERIOD_S,
        step_s=0.5,
    )


@pytest.mark.parametrize("routing", TECHNIQUES)
def test_a_gateway_without_internet_relays_to_the_other_one(routing):
    network = Network(seed=1, routing=routing)
    network.add_router(2, 0.0, 0.0)
    network.add_gateway(0, 6.0, 0.0)  # the only way from router 2 to gateway 1
    network.add_router(3, 12.0, 0.0)
    network.add_gateway(1, 18.0, 0.0)
    network.run_for(30.0)
    network.internet(0, False)
    assert run_until(network, lambda: network.hops(2) == 3, CHECK_PERIOD_S + 2.0, step_s=0.5)
    assert network.path_to_gateway(2) == [2, 0, 3, 1]
    assert network.order(2, x=1.0, y=1.0, gateway=1)
    assert run_until(network, lambda: network.location(2).latitude == 1.0, 30.0, step_s=1.0)


@pytest.mark.parametrize("routing", TECHNIQUES)
def test_without_another_gateway_no_drone_is_connected_and_none_flies_for_that(routing):
    network = fleet(4, gridsize=2, routing=routing)
    network.run_for(20.0)
    network.internet(0, False)
    routers = range(1, 5)
    assert run_until(
        network, lambda: not any(map(network.connected, routers)), CHECK_PERIOD_S + 2.0, step_s=0.5
    )
    network.run_for(60.0)  # twice the time after which a lost router flies
    assert flown(network) == set()
    assert not any(map(network.connected, [0, *routers]))
    network.internet(0, True)
    assert run_until(network, network.all_connected, CHECK_PERIOD_S + 2.0, step_s=0.5)


@pytest.mark.slow
@pytest.mark.parametrize("routing", TECHNIQUES)
def test_a_gateway_that_is_gone_besides_is_looked_for(routing):
    network = line(3, seed=1, routing=routing)
    network.run_for(30.0)
    network.internet(0, False)
    network.run_for(30.0)
    network.power(0, False)
    assert run_until(network, lambda: flown(network), 150.0)


@pytest.mark.slow
@pytest.mark.parametrize("routing", TECHNIQUES)
def test_two_gateways_without_internet_wait_for_the_first_that_has_it_again(routing):
    network = two_ends(routing, routers=3)
    network.internet(0, False)
    network.internet(1, False)
    network.run_for(60.0)
    assert not any(map(network.connected, network.nodes))
    network.internet(1, True)
    assert run_until(network, network.all_connected, 2 * CHECK_PERIOD_S + 2.0, step_s=0.5)
    assert set(preferred(network, network.nodes)) == {1}
    assert flown(network) == set()


@pytest.mark.parametrize("routing", TECHNIQUES)
def test_the_loss_and_the_return_are_events_of_the_gateway(routing):
    network = fleet(1, gridsize=1, routing=routing)
    network.run_for(5.0)
    network.internet(0, False)
    network.internet(0, False)
    network.internet(0, True)
    assert [e[1:] for e in events(network, "DISCONNECTED", since_s=5.0) if e[1] == 0] == [(0, 0)]
    assert [e[1:] for e in events(network, "CONNECTED", since_s=5.0) if e[1] == 0] == [(0, 0)]


@pytest.mark.parametrize("routing", TECHNIQUES)
def test_with_a_key_a_gateway_without_internet_reports_and_obeys_the_other_one(routing):
    timing = MeshTiming(report_period_s=30.0)
    network = two_ends(routing, routers=1, key=MeshKey(bytes(range(16))), timing=timing)
    network.internet(1, False)
    network.run_for(100.0)
    reports = network.nodes[0].component.get_node_reports()
    assert {1, 2} <= {report.node_id for report in reports}
    assert network.order(1, x=12.0, y=1.0, gateway=0)
    network.run_for(60.0)
    assert network.location(1).latitude == 1.0
    (order,) = network.nodes[0].component.get_orders()
    assert order.state is OrderState.ARRIVED
