"""Drones that pilots fly: the mesh follows their positions and is told nothing."""

from __future__ import annotations

import math

import pytest

from drone_mesh.communication.events.observer import MeshEventKind
from drone_mesh.drone.location import Location
from drone_mesh.errors import ConfigurationError
from drone_mesh.inprocess import Network
from drone_mesh.mobility import Area, Mobility, tracks_of
from drone_mesh.mobility.track import Legs, leg_to, legs_between

AREA = Area(0.0, 0.0, 30.0, 30.0)


def fleet(radio, drones=20, **options):
    network = Network(seed=3, radio=radio, **options)
    network.add_gateway(0, 15.0, 15.0)
    for node in range(1, drones):
        network.add_router(node, 3.0 * (node % 10), 3.0 * (node // 10))
    return network


def fly(network, kind="random_waypoint", **numbers):
    places = {node: network.location(node).to_vector() for node in network.nodes}
    tracks = tracks_of(Mobility(kind, **numbers), places, {0}, AREA, 7)
    return tracks, network.fly(tracks)


def links_by_distance(network):
    nodes = network.nodes
    return {
        (a, b)
        for a in nodes
        for b in nodes
        if a < b and math.dist(network.location(a), network.location(b)) < 9.0
    }


def links(network):
    return {(a, b) for a in network.nodes for b in network.links(a) if a < b}


@pytest.mark.parametrize("radio", ["disc", "shared", "chips"])
def test_links_follow_the_drones(radio):
    network = fleet(radio)
    tracks, _pilots = fly(network, speed_m_s=(1.0, 1.0))
    seen = set()
    for _ in range(20):
        network.run_for(1.0)
        assert links(network) == links_by_distance(network)
        seen.add(frozenset(links(network)))
        for node, track in tracks.items():
            now = track.position_at(network.now_s())
            assert math.dist(network.location(node).to_vector(), now) <= 0.1 + 1e-6
    assert len(seen) > 10


def test_a_cut_link_stays_cut_while_the_drones_move():
    network = fleet("disc", drones=3)
    path = [(0.0, (12.0, 15.0, 0.0)), (5.0, (3.0, 15.0, 0.0)), (10.0, (12.0, 15.0, 0.0))]
    network.fly({1: Legs(legs_between(path))})
    network.run_for(1.0)
    assert (0, 1) in links(network)
    network.air.cut(0, 1)
    for _ in range(12):
        network.run_for(1.0)
        assert (0, 1) not in links(network)
    network.air.cut(0, 1, off=False)
    assert (0, 1) in links(network)


def test_walls_hide_moving_drones_behind_them():
    network = fleet("disc", drones=2)
    network.air.sees = lambda one, other: one.longitude < 10.0 and other.longitude < 10.0
    network.fly({0: Legs([leg_to(0.0, 10.0, (5.0, 15.0, 0.0), (5.0, 15.1, 0.0))]),
                 1: Legs([leg_to(0.0, 10.0, (8.0, 15.0, 0.0), (13.0, 15.0, 0.0))])})  # fmt: skip
    network.run_for(3.0)
    assert links(network) == {(0, 1)}
    network.run_for(3.0)
    assert links(network) == set()


def test_the_mesh_is_not_told_of_a_pilots_flight():
    network = fleet("disc", drones=6)
    track = Legs([leg_to(0.0, 60.0, (12.0, 15.0, 0.0), (16.0, 15.0, 0.0))])
    network.fly({1: track})
    network.run_for(60.0)
    kinds = {event.kind for event in network.events if event.node == 1}
    assert not kinds & {MeshEventKind.FLIGHT_ORDERED, MeshEventKind.LANDED}
    assert network.connected(1)


def test_an_order_ends_the_pilots_flight():
    network = fleet("disc", drones=4)
    for node in (1, 2, 3):
        network.nodes[node].drone.put(Location(15.0, 15.0 + node, 0.0))
    tracks = {
        node: Legs([leg_to(0.0, 400.0, (15.0 + node, 15.0, 0.0), (15.0 + node, 19.0, 0.0))])
        for node in (1, 2)
    }
    pilots = network.fly(tracks)
    assert network.run_until(network.all_connected, within_s=30.0)
    assert network.order(1, 12.0, 12.0)
    assert network.run_until(lambda: network.location(1) == Location(12.0, 12.0, 0.0), 30.0)
    assert pilots.flying == [2]
    network.run_for(10.0)
    assert network.location(1) == Location(12.0, 12.0, 0.0)
    assert links(network) == links_by_distance(network)


def test_a_track_of_a_drone_that_is_not_in_the_network_is_refused():
    network = fleet("disc", drones=3)
    track = Legs(legs_between([(0.0, (0.0, 0.0, 0.0))]))
    with pytest.raises(ConfigurationError, match="drone 50 has a track and is not in the network"):
        network.fly({1: track, 50: track})
