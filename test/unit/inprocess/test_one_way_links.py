"""Links that work one way only: connected means proved in both directions."""

from __future__ import annotations

import pytest
from scenarios import placed

from drone_mesh.communication.data.outgoing import TicketState
from drone_mesh.communication.events.observer import MeshEventKind
from drone_mesh.communication.node.node_configuration import ROUTING_TECHNIQUES
from drone_mesh.communication.wire.packet_types import MessageType
from drone_mesh.inprocess import Network
from drone_mesh.nrf24.emulator.links import IdealDisc, ScriptedLoss

RANGE_M = 8.0
EVERYBODY = range(10)


def network_with(places, routing="beacon", radio="shared"):
    """Nodes at these x, y; the first is the gateway. `network.lost`: links that carry nothing."""
    lost = set()
    links = ScriptedLoss(IdealDisc(RANGE_M), lambda hop: (hop.sender, hop.receiver) in lost)
    options = {"routing": routing, "radio": radio, "links": links, "max_distance_m": RANGE_M}
    network = placed(places, seed=1, **options)
    if radio == "disc":
        network.air.hears = lambda sender, receiver: (sender, receiver) not in lost
    return network, lost


def line(nodes, **settings):
    return network_with([(6.0 * node, 0.0) for node in range(nodes)], **settings)


def mute(node):
    return {(node, other) for other in EVERYBODY}


def flights(network, node):
    decided = [e for e in network.events if e.kind is MeshEventKind.FLIGHT_DECIDED]
    return sum(event.node == node for event in decided)


@pytest.mark.parametrize("radio", ["disc", "shared"])
@pytest.mark.parametrize("routing", sorted(ROUTING_TECHNIQUES))
def test_a_router_that_nobody_hears_any_more_is_soon_not_connected(routing, radio):
    network, lost = line(3, routing=routing, radio=radio)
    network.run_for(40.0)
    assert network.connected(2)
    lost |= mute(2)
    network.run_for(30.0)
    for _ in range(30):
        assert not network.connected(2)
        network.run_for(1.0)


@pytest.mark.parametrize("radio", ["disc", "shared"])
@pytest.mark.parametrize("routing", sorted(ROUTING_TECHNIQUES))
def test_a_router_that_nobody_ever_heard_never_was_connected(routing, radio):
    network, lost = line(3, routing=routing, radio=radio)
    lost |= mute(2)
    for _ in range(60):
        network.run_for(1.0)
        assert not network.connected(2)


def test_the_chips_of_a_mute_router_show_it_too():
    network, lost = line(2, radio="chips")
    lost |= {(f"node {one}", f"node {other}") for one, other in mute(1)}
    network.run_for(8.0)
    assert not network.connected(1)
    lost.clear()
    assert network.run_until(lambda: network.connected(1), within_s=15.0)
    network.stop()


@pytest.mark.parametrize("radio", ["disc", "shared"])
def test_a_link_that_works_one_way_only_is_repaired_from_nearer(radio):
    """3 sends with less power: 2 no longer hears it where it stands."""
    network, lost = line(4, radio=radio)
    network.run_for(40.0)
    weak = {(3, 2)}
    lost |= weak
    start = network.location(3)
    assert network.run_until(lambda: flights(network, 3) == 1, within_s=40.0)
    assert network.run_until(lambda: network.connected(3), within_s=20.0)  # through 1
    assert network.location(3).distance_m(start) > 3.0
    network.run_for(200.0)
    assert network.connected(3)
    assert flights(network, 3) == 1


def test_a_drone_whose_transmitter_is_broken_comes_to_rest_and_says_why():
    network, lost = line(4)
    network.run_for(40.0)
    lost |= mute(3)
    network.run_for(500.0)
    decided = flights(network, 3)
    assert 1 <= decided <= 4
    network.run_for(500.0)
    assert flights(network, 3) == decided
    words = network.nodes[3].component.get_repair_status().in_words(network.now_s())
    assert "hears others and is not heard: its transmitter may be broken" in words


def test_the_way_leads_around_a_neighbour_that_does_not_hear_this_node():
    network, lost = network_with([(0.0, 0.0), (4.0, 3.0), (7.0, 0.0)])
    network.run_for(20.0)
    assert network.nodes[2].component.control.next_hop() == 0
    lost.add((2, 0))
    network.run_for(20.0)
    assert network.nodes[2].component.control.next_hop() == 1
    assert network.connected(2)
    tickets = [network.send(2, 0, b"x") for _ in range(5)]
    network.run_for(2.0)
    assert {ticket.state for ticket in tickets} == {TicketState.DELIVERED}
    network.run_for(60.0)  # it is still asked now and then, and serves again once it answers
    assert network.nodes[2].component.control.next_hop() == 1
    lost.clear()
    network.run_for(15.0)
    assert network.nodes[2].component.control.next_hop() == 0


def test_who_hears_only_a_router_without_a_proved_way_is_not_connected_either():
    network, lost = line(4)
    lost.add((2, 1))
    network.run_for(8.0)
    assert network.connected(1)
    assert not network.connected(2)
    assert not network.connected(3)


def test_no_repair_takes_a_deaf_neighbour_for_one_who_answers():
    network, lost = line(3)
    network.run_for(20.0)
    lost.add((2, 1))
    network.run_for(14.0)
    component = network.nodes[2].component
    assert component.control.routes.get_set_of_children() == frozenset()
    assert 1 not in component.get_neighbours()


def test_a_parent_that_names_its_children_is_seldom_asked():
    network = Network(seed=1, routing="beacon", radio="shared")
    network.add_fleet(gateways=1, routers=16, gridsize=4, spacing=6.0)
    probes = []
    network.air.on_packet = lambda payload: (
        probes.append(payload) if payload[2] == MessageType.PROBE else None
    )
    network.run_for(20.0)
    assert len(probes) <= 3 * 16  # about one for each, to be connected at once
    del probes[:]
    network.run_for(60.0)
    assert len(probes) <= 2 * 16
