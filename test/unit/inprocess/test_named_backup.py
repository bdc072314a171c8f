"""A backup that was named beforehand flies at once, and only if its principal is really gone."""

from __future__ import annotations

import pytest
from scenarios import events, flown, outage, placed

from drone_mesh.communication.repair.election import BACKUP
from drone_mesh.communication.wire.messages import (
    GatewayPlace,
    MovementNegotiationMessage,
    addressed,
)
from drone_mesh.drone.location import Location

GROUP = ((0, 0), (8, 0), (14, 5), (16, -2), (22, 4), (22, -6), (29, 0))  # only 1 leads to 0
LEAF = ((0, 0), (8, 0), (16, 0), (5, 5))  # 2 hears 1 and nobody else


def named(places, routing="beacon"):
    network = placed(places, repair="named_backup", routing=routing)
    network.run_for(40.0)
    return network


def departures(network, since_s):
    return {n: at_s - since_s for at_s, n, _ in events(network, "FLIGHT_DECIDED", since_s=since_s)}


@pytest.mark.parametrize(
    ("places", "fly"),
    [(GROUP, {2}), (LEAF, {2}), ([(8 * node, 0) for node in range(6)], {2, 3, 4, 5})],
    ids=["a group keeps its links", "a leaf", "a line follows in a cascade"],
)
def test_with_beacons_backups_depart_within_3_s_and_all_are_connected_within_8(places, fly):
    network = named(places)
    died_s = network.now_s()
    network.power(1, False)
    network.run_for(8.0)
    assert network.all_connected()
    left = departures(network, died_s)
    assert left.keys() == fly
    assert max(left.values()) <= 3.0
    network.run_for(60.0)
    assert network.all_connected()
    assert flown(network, since_s=died_s) == fly


def test_with_heartbeats_the_first_check_that_notices_sends_the_backup():
    network = named([(8 * node, 0) for node in range(4)], routing="child_table_tree")
    died_s = network.now_s()
    network.power(1, False)
    network.run_for(30.0)  # with an election it would only begin now
    assert network.all_connected()
    assert max(departures(network, died_s).values()) <= 21.0  # two checks and an answer


@pytest.mark.parametrize("places", [GROUP, LEAF])
def test_no_backup_flies_when_the_gateway_is_off_for_a_moment(places):
    network = named(places)
    network.power(0, False)
    network.run_for(8.0)
    network.power(0, True)
    network.run_for(60.0)
    assert flown(network) == set()
    assert network.all_connected()


def test_a_node_whose_beacons_show_that_it_flies_away_is_not_dead():
    network = named(GROUP)
    network.order(1, 8.0, -40.0)
    network.run_for(9.0)  # without a backup nobody waits any shorter
    assert not network.connected(2)
    assert flown(network) == set()


def test_a_name_from_a_node_that_is_no_neighbour_sends_nobody():
    network = named(GROUP)
    name = MovementNegotiationMessage(9, 9, 9, 9, BACKUP).to_payload()
    beside_5 = GatewayPlace(0, Location(-12.0, 22.0, 0.0), 0.0)
    packet = addressed(beside_5.appended_to(name), 5)
    network.nodes[5].component.on_msg(packet, network.now_s())
    network.power(1, False)
    network.run_for(8.0)
    assert flown(network) == {2}


@pytest.mark.parametrize(("places", "leaves"), [(GROUP, {5, 6}), (LEAF, {2})])
def test_in_a_short_failure_of_the_medium_only_leaves_fly_and_they_come_back(places, leaves):
    network = named(places)
    outage(network, 4.0)
    network.run_for(60.0)
    assert network.all_connected()
    assert flown(network) == leaves
    for node in leaves:
        x, y = places[node]
        here = network.location(node)
        assert (here.longitude, here.latitude) == pytest.approx((x, y), abs=0.1)


def test_a_leaf_with_heartbeats_waits_as_long_as_without_a_backup():
    network = named(LEAF, routing="child_table_tree")
    outage(network, 25.0)
    network.run_for(60.0)
    assert flown(network) == set()
